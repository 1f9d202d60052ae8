import { idOf, pageOf, rigOf, rigPath } from '../api';
import type { ListRecalibrationsResponse, Recalibration, SolverReport } from '../contract';
import { RigChoice, kRigFilter, rigColumn } from '../fleet';
import { number, words } from '../format';
import { ListPage } from '../list';
import { Badge, Link, When } from '../parts';
import type { Column } from '../table';

export function costs(solver: SolverReport): string {
  return `${number(solver.initialCost)} to ${number(solver.finalCost)}`;
}

export function Result(props: { of: Recalibration }) {
  const { calibration } = props.of;
  return <Link to={pageOf(calibration)}>version {idOf(calibration)}</Link>;
}

const kRun: Column<Recalibration> = {
  head: 'Run',
  cell: (run) => <Link to={pageOf(run.name)}>{idOf(run.name)}</Link>,
  value: (run) => Number(idOf(run.name)),
};

const kDetails: Column<Recalibration>[] = [
  { head: 'State', cell: (run) => <Badge state={run.state} />, value: (run) => words(run.state) },
  { head: 'Trigger', cell: (run) => words(run.trigger), value: (run) => words(run.trigger) },
  {
    head: 'Created',
    cell: (run) => <When time={run.createTime} />,
    value: (run) => Date.parse(run.createTime ?? ''),
  },
  {
    head: 'Segments',
    cell: (run) => run.segments.length,
    value: (run) => run.segments.length,
  },
  {
    head: 'Cost',
    cell: (run) => run.solver && costs(run.solver),
    value: (run) => run.solver?.finalCost,
  },
  {
    head: 'Result',
    cell: (run) => run.calibration && <Result of={run} />,
    value: (run) => (run.calibration ? Number(idOf(run.calibration)) : undefined),
  },
  { head: 'Message', cell: (run) => run.message, value: (run) => run.message, wide: true },
];

const kColumns = [kRun, ...kDetails];
const kColumnsAcrossRigs = [kRun, rigColumn((run: Recalibration) => rigOf(run.name)), ...kDetails];

const itemsOf = (response: ListRecalibrationsResponse) => response.recalibrations;

// The runs of all rigs, or of those of a filter.
export function FleetRuns(props: { version: number }) {
  return (
    <ListPage
      title="Runs"
      path="recalibrations"
      items={itemsOf}
      query={[kRigFilter]}
      version={props.version}
      columns={kColumnsAcrossRigs}
      next="Older runs"
      empty="None of these rigs has a run."
      above={(mistake) => <RigChoice mistake={mistake} />}
    />
  );
}

export function Runs(props: { rig: string; version: number }) {
  return (
    <ListPage
      title={'Runs of ' + props.rig}
      path={rigPath(props.rig) + '/recalibrations'}
      items={itemsOf}
      version={props.version}
      columns={kColumns}
      next="Older runs"
      empty={
        <>
          There are no runs yet. A run starts when the tables are full;{' '}
          <code>selfcal run start {props.rig}</code> starts one manually.
        </>
      }
    />
  );
}
