// One run: its progress while it computes, and its result.
import { useEffect, useState } from 'preact/hooks';
import { rigPath, type ApiError } from '../api';
import type { Recalibration } from '../contract';
import { Convergence, type Step } from '../convergence';
import { number, words } from '../format';
import {
  Badge,
  Empty,
  Figures,
  Loaded,
  Problem,
  SegmentLinks,
  solverFigures,
  Title,
  When,
} from '../parts';
import { useRead } from '../state';
import { openStream } from '../stream';
import { costs, Result } from './runs';

function isRunning(run: Recalibration): boolean {
  return run.state === 'PENDING' || run.state === 'RUNNING';
}

// Adds the step, in order; of several updates about an iteration, the first is
// used.
function withStep(steps: Step[], run: Recalibration): Step[] {
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

// The iterations as the daemon keeps them once the run has ended.
function stepsOf(run: Recalibration): Step[] {
  return run.convergence.map((step) => ({
    iteration: step.iteration,
    cost: step.cost,
    step: step.stepSigmas,
    parameters: step.parameters,
  }));
}

interface Progress {
  steps: Step[]; // all iterations from the first
  now: Recalibration | null;
  error: ApiError | null; // the reason why there are no more updates
}

// Watches a run until it has ended; the steps are kept after that.
function useProgress(path: string, running: boolean): Progress {
  const [steps, setSteps] = useState<Step[]>([]);
  const [now, setNow] = useState<Recalibration | null>(null);
  const [error, setError] = useState<ApiError | null>(null);
  useEffect(() => {
    if (!running) return;
    // The daemon ends the stream when the run has ended; the browser would open
    // it again.
    const close = openStream<Recalibration>(path + ':watch', {
      onMessage: (update) => {
        setError(null);
        setNow(update);
        setSteps((before) => withStep(before, update));
        if (!isRunning(update)) close();
      },
      onError: (failure) => {
        setError(failure);
        if (failure.code !== 'UNAVAILABLE') close();
      },
    });
    return close;
  }, [path, running]);
  return { steps, now, error };
}

function Report(props: { run: Recalibration }) {
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

function Going(props: { run: Recalibration }) {
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
  const path = `${rigPath(props.rig)}/recalibrations/${encodeURIComponent(props.run)}`;
  const read = useRead<Recalibration>(path, props.version);
  const { steps, now, error } = useProgress(path, read.value !== null && isRunning(read.value));
  const title = `Run ${props.run} of ${props.rig}`;
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {(run) => {
          const shown = isRunning(run) && now ? { ...run, ...now } : run;
          const iterations = steps.length > 0 ? steps : stepsOf(run);
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
              {isRunning(shown) && (error ? <Problem error={error} /> : <Going run={shown} />)}
              <Report run={run} />
              {iterations.length > 0 && <Convergence steps={iterations} />}
              {isRunning(shown) && iterations.length === 0 && (
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
