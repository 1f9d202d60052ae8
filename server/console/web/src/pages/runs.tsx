import { useEffect, useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import { idOf, pageOf, rigPath, type Run, type Solver } from '../api';
import { number, words } from '../format';
import { ListPage, type Column } from '../list';
import {
  Badge,
  Empty,
  Figures,
  Link,
  Loaded,
  SegmentLinks,
  solverFigures,
  Title,
  When,
} from '../parts';
import { kColours, Plot } from '../plot';
import { useRead } from '../state';

function isRunning(run: Run): boolean {
  return run.state === 'PENDING' || run.state === 'RUNNING';
}

function costs(solver: Solver): string {
  return `${number(solver.initialCost)} to ${number(solver.finalCost)}`;
}

function Result(props: { of: Run }) {
  const { calibration } = props.of;
  return <Link to={pageOf(calibration)}>version {idOf(calibration)}</Link>;
}

const kColumns: Column<Run>[] = [
  { head: 'Run', cell: (run) => <Link to={pageOf(run.name)}>{idOf(run.name)}</Link> },
  { head: 'State', cell: (run) => <Badge state={run.state} /> },
  { head: 'Why', cell: (run) => words(run.trigger) },
  { head: 'Begun', cell: (run) => <When time={run.createTime} /> },
  { head: 'Segments', cell: (run) => run.segments.length },
  { head: 'Cost', cell: (run) => run.solver && costs(run.solver) },
  { head: 'Result', cell: (run) => run.calibration && <Result of={run} /> },
  { head: 'Message', cell: (run) => run.message },
];

export function Runs(props: { rig: string; version: number }) {
  return (
    <ListPage
      title={'Runs of ' + props.rig}
      path={rigPath(props.rig) + '/recalibrations'}
      items="recalibrations"
      version={props.version}
      columns={kColumns}
      next="Older runs"
      empty={
        <>
          No run yet. One begins when the tables are full;{' '}
          <code>selfcal recalibrate {props.rig}</code> starts one by hand.
        </>
      }
    />
  );
}

interface Step {
  iteration: number;
  cost: number;
  step: number;
}

// Each iteration since the page was opened.
function useSteps(name: string, running: boolean): { steps: Step[]; now: Run | null } {
  const [steps, setSteps] = useState<Step[]>([]);
  const [now, setNow] = useState<Run | null>(null);
  useEffect(() => {
    if (!running) return;
    const source = new EventSource('/api/v1/stream?run=' + encodeURIComponent(name));
    source.addEventListener('run', (event) => {
      const run = JSON.parse((event as MessageEvent<string>).data) as Partial<Run>;
      if (!run.name) return;
      const told = run as Run;
      setNow(told);
      if (told.iteration > 0) {
        setSteps((before) => [
          ...before.filter((s) => s.iteration !== told.iteration),
          { iteration: told.iteration, cost: told.cost, step: told.stepSigmas },
        ]);
      }
      if (!isRunning(told)) source.close();
    });
    return () => source.close();
  }, [name, running]);
  return { steps, now };
}

function Progress(props: { steps: Step[] }) {
  const sorted = [...props.steps].sort((a, b) => a.iteration - b.iteration);
  const x = sorted.map((s) => s.iteration);
  const cost = useMemo(() => [x, sorted.map((s) => s.cost)] as uPlot.AlignedData, [props.steps]);
  const step = useMemo(() => [x, sorted.map((s) => s.step)] as uPlot.AlignedData, [props.steps]);
  return (
    <div class="side">
      <Plot label="Cost by iteration" data={cost} x={{ label: 'iteration', integers: true }} y="cost"
        series={[{ label: 'cost', stroke: kColours[0], width: 2 }]} />
      <Plot label="Largest step of a parameter by iteration" data={step}
        x={{ label: 'iteration', integers: true }} y="step [sigmas]"
        series={[{ label: 'step', stroke: kColours[1], width: 2 }]} />
    </div>
  );
}

function Report(props: { run: Run }) {
  const solver = props.run.solver;
  if (!solver) return null;
  const said = solverFigures(solver);
  return (
    <>
      <h2>What the solver says</h2>
      <Figures
        of={[
          ['Status', solver.status],
          said.iterations,
          ['Cost', costs(solver)],
          said.reprojection,
          said.rank,
          ['Keyframes', solver.keyframes],
          ['Landmarks', solver.landmarks],
          ['Time', number(solver.seconds) + ' s'],
        ]}
      />
    </>
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
                  ['Why', words(shown.trigger)],
                  ['Begun', <When time={shown.createTime} />],
                  ['Segments', shown.segments.length],
                  ['Attempts', shown.attempts],
                  isRunning(shown)
                    ? ['Iteration', `${shown.iteration} of ${shown.maxIterations}`]
                    : null,
                  shown.calibration ? ['Result', <Result of={shown} />] : null,
                ]}
              />
              {shown.message && <p class="warning">{shown.message}</p>}
              {steps.length > 0 && <Progress steps={steps} />}
              {isRunning(shown) && steps.length === 0 && (
                <Empty>Iterations are drawn here as they come.</Empty>
              )}
              <Report run={run} />
              <h2>Segments</h2>
              <SegmentLinks names={shown.segments} />
            </>
          );
        }}
      </Loaded>
    </>
  );
}
