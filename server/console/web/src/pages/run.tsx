// One run: its progress while it computes, and its result.
import { useEffect, useState } from 'preact/hooks';
import { rigPath, type Run } from '../api';
import { Convergence, type Step } from '../convergence';
import { number, words } from '../format';
import { Badge, Empty, Figures, Loaded, SegmentLinks, solverFigures, Title, When } from '../parts';
import { useRead } from '../state';
import { costs, Result } from './runs';

function isRunning(run: Run): boolean {
  return run.state === 'PENDING' || run.state === 'RUNNING';
}

// Adds the step, in order; of several updates about an iteration, the first is
// used.
function withStep(steps: Step[], run: Run): Step[] {
  if (run.iteration === 0 && run.parameters.length === 0) return steps;
  if (steps.some((s) => s.iteration === run.iteration)) return steps;
  const step = {
    iteration: run.iteration,
    cost: run.cost,
    step: run.stepSigmas,
    parameters: run.parameters,
  };
  return [...steps, step].sort((a, b) => a.iteration - b.iteration);
}

// All iterations from the first; they are kept when the run has ended.
function useSteps(name: string, running: boolean): { steps: Step[]; now: Run | null } {
  const [steps, setSteps] = useState<Step[]>([]);
  const [now, setNow] = useState<Run | null>(null);
  useEffect(() => {
    if (!running) return;
    const source = new EventSource('/api/v1/stream?run=' + encodeURIComponent(name));
    source.addEventListener('run', (event) => {
      const update = JSON.parse((event as MessageEvent<string>).data) as Run;
      // An update without a name means that the daemon has skipped some.
      if (!update.name) return;
      setNow(update);
      setSteps((before) => withStep(before, update));
      if (!isRunning(update)) source.close();
    });
    return () => source.close();
  }, [name, running]);
  return { steps, now };
}

function Report(props: { run: Run }) {
  const solver = props.run.solver;
  if (!solver) return null;
  const figures = solverFigures(solver);
  return (
    <>
      <h2>Solver report</h2>
      <Figures
        of={[
          ['Status', solver.status],
          figures.iterations,
          ['Cost', costs(solver)],
          figures.reprojection,
          figures.rank,
          ['Keyframes', solver.keyframes],
          ['Landmarks', solver.landmarks],
          ['Time', number(solver.seconds) + ' s'],
        ]}
      />
    </>
  );
}

function Going(props: { run: Run }) {
  const { iteration, maxIterations, cost, state } = props.run;
  return (
    <p role="status">
      {state === 'PENDING'
        ? 'The run is waiting.'
        : iteration === 0
          ? 'The run has started.'
          : `Iteration ${iteration} of at most ${maxIterations}, cost ${number(cost, 4)}.`}
    </p>
  );
}

export function RunPage(props: { rig: string; run: string; version: number }) {
  const name = `rigs/${props.rig}/recalibrations/${props.run}`;
  const read = useRead<Run>(
    `${rigPath(props.rig)}/recalibrations/${encodeURIComponent(props.run)}`,
    props.version,
  );
  const { steps, now } = useSteps(name, read.value !== null && isRunning(read.value));
  const title = `Run ${props.run} of ${props.rig}`;
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {(run) => {
          const shown = isRunning(run) && now ? { ...run, ...now } : run;
          return (
            <>
              <Figures
                of={[
                  ['State', <Badge state={shown.state} />],
                  ['Trigger', words(shown.trigger)],
                  ['Created', <When time={shown.createTime} />],
                  ['Segments', shown.segments.length],
                  ['Attempts', shown.attempts],
                  shown.calibration ? ['Result', <Result of={shown} />] : null,
                ]}
              />
              {shown.message && <p class="warning">{shown.message}</p>}
              {isRunning(shown) && <Going run={shown} />}
              <Report run={run} />
              {steps.length > 0 && <Convergence steps={steps} />}
              {isRunning(shown) && steps.length === 0 && (
                <Empty>Iterations are shown here as they are computed.</Empty>
              )}
              <h2>Segments</h2>
              <SegmentLinks names={shown.segments} />
            </>
          );
        }}
      </Loaded>
    </>
  );
}
