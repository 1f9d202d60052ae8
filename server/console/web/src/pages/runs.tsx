import type { ComponentChildren } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import { idOf, pageOf, type Run } from '../api';
import { number, words } from '../format';
import { Badge, DataTable, Empty, Figures, Link, Loaded, Pager, Title, When } from '../parts';
import { kColours, Plot } from '../plot';
import { useAddress, useRead, withQuery } from '../state';

function isRunning(run: Run): boolean {
  return run.state === 'PENDING' || run.state === 'RUNNING';
}

export function Runs(props: { rig: string; version: number }) {
  const token = useAddress().searchParams.get('page_token') ?? '';
  const read = useRead<{ recalibrations: Run[]; nextPageToken: string }>(
    `rigs/${encodeURIComponent(props.rig)}/recalibrations?page_token=${token}`,
    props.version,
  );
  const title = 'Runs of ' + props.rig;
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {(listed) =>
          listed.recalibrations.length === 0 ? (
            <Empty>
              No run yet. One begins when the tables are full;{' '}
              <code>selfcal recalibrate {props.rig}</code> starts one by hand.
            </Empty>
          ) : (
            <>
              <DataTable
                caption={title}
                hideCaption
                head={['Run', 'State', 'Why', 'Begun', 'Segments', 'Cost', 'Result', 'Message']}
                rows={listed.recalibrations.map((run) => [
                  <Link to={pageOf(run.name)}>{idOf(run.name)}</Link>,
                  <Badge state={run.state} />,
                  words(run.trigger),
                  <When time={run.createTime} />,
                  run.segments.length,
                  run.solver
                    ? `${number(run.solver.initialCost)} to ${number(run.solver.finalCost)}`
                    : '',
                  run.calibration && (
                    <Link to={pageOf(run.calibration)}>
                      version {idOf(run.calibration)}
                    </Link>
                  ),
                  run.message,
                ])}
              />
              <Pager
                next="Older runs"
                first={token ? withQuery({ page_token: '' }) : null}
                more={
                  listed.nextPageToken
                    ? withQuery({ page_token: listed.nextPageToken })
                    : null
                }
              />
            </>
          )
        }
      </Loaded>
    </>
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
  return (
    <>
      <h2>What the solver says</h2>
      <Figures
        of={[
          ['Status', solver.status],
          ['Iterations', solver.iterations],
          ['Cost', `${number(solver.initialCost)} to ${number(solver.finalCost)}`],
          ['Reprojection rms', `${number(solver.reprojectionRmsBeforePx)} to ${number(solver.reprojectionRmsAfterPx)} px`],
          ['Rank', `${solver.rank} of ${solver.components}`],
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
    `rigs/${encodeURIComponent(props.rig)}/recalibrations/${encodeURIComponent(props.run)}`,
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
                  ...(isRunning(shown)
                    ? ([['Iteration', `${shown.iteration} of ${shown.maxIterations}`]] as [string, string][])
                    : []),
                  ...(shown.calibration
                    ? ([['Result', <Link to={pageOf(shown.calibration)}>version {idOf(shown.calibration)}</Link>]] as [string, ComponentChildren][])
                    : []),
                ]}
              />
              {shown.message && <p class="warning">{shown.message}</p>}
              {steps.length > 0 && <Progress steps={steps} />}
              {isRunning(shown) && steps.length === 0 && (
                <Empty>Iterations are drawn here as they come.</Empty>
              )}
              <Report run={run} />
              <h2>Segments</h2>
              <ul class="columns">
                {shown.segments.map((segment) => (
                  <li key={segment}>
                    <Link to={pageOf(segment)}>{decodeURIComponent(idOf(segment))}</Link>
                  </li>
                ))}
              </ul>
            </>
          );
        }}
      </Loaded>
    </>
  );
}
