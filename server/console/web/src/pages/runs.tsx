import { idOf, pageOf, rigOf, rigPath } from '../api';
import {
  Recalibration_State,
  Recalibration_Trigger,
  type ListRecalibrationsResponse,
  type Recalibration,
  type SolverReport,
} from '../contract';
import { kRigFilter, rigColumn } from '../fleet';
import { number, words } from '../format';
import { ListPage } from '../list';
import {
  ListFilter,
  NoMatch,
  isNarrowed,
  valuesOf,
  type FilterSyntax,
  type Menu,
} from '../list_filter';
import { Badge, Link, When } from '../parts';
import { useAddress } from '../state';
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
    order: 'create_time',
  },
  {
    head: 'Duration [s]',
    cell: ({ createTime, endTime }) =>
      createTime && endTime && number((Date.parse(endTime) - Date.parse(createTime)) / 1000),
    order: 'duration',
    partial: true,
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

const kMenus: Menu[] = [
  { name: 'state', label: 'State', of: valuesOf(Recalibration_State) },
  { name: 'trigger', label: 'Trigger', of: valuesOf(Recalibration_Trigger) },
];

const kSyntax: FilterSyntax = {
  items: 'runs',
  equal: [
    ['state', kMenus[0].of.join(', ')],
    ['trigger', kMenus[1].of.join(', ')],
  ],
  compared: [['create_time']],
  examples: [
    'state = FAILED',
    'trigger = MANUAL AND state = SUCCEEDED',
    'create_time >= 2026-11-21T04:00:00Z',
  ],
};

function Nothing(props: { rig: string }) {
  if (isNarrowed(useAddress().searchParams, kMenus)) return <NoMatch item="run" menus={kMenus} />;
  if (!props.rig) return <p>None of these rigs has a run.</p>;
  return (
    <p>
      There are no runs yet. A run starts when the tables are full;{' '}
      <code>selfcal run start {props.rig}</code> starts one manually.
    </p>
  );
}

// The runs of one rig, or of those of a filter if `rig` is ''.
export function Runs(props: { rig: string; version: number }) {
  const { rig } = props;
  return (
    <ListPage
      title={rig ? 'Runs of ' + rig : 'Runs'}
      path={rig ? rigPath(rig) + '/recalibrations' : 'recalibrations'}
      items={itemsOf}
      query={rig ? [] : [kRigFilter]}
      menus={kMenus}
      order={['create_time', 'desc']}
      version={props.version}
      columns={rig ? kColumns : kColumnsAcrossRigs}
      next="Older runs"
      empty={<Nothing rig={rig} />}
      above={(mistake) => (
        <ListFilter mistake={mistake} acrossRigs={!rig} syntax={kSyntax} menus={kMenus} />
      )}
    />
  );
}
