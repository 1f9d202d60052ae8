import { useMemo, useState } from 'preact/hooks';
import { mayAdminister } from '../action';
import { idOf, pageOf, rigPath } from '../api';
import type {
  Caller,
  GroupScore,
  ListTablesResponse,
  Segment,
  SegmentInformation,
  SegmentInformation_Component,
  Table,
  Table_Entry,
  TableExclusion,
  UnobservedDirection,
} from '../contract';
import { bytes, clock, component, heading, number, shownUnit, sigmaText } from '../format';
import {
  Badge,
  Empty,
  Figures,
  Link,
  Loaded,
  NameLink,
  Remaining,
  SegmentLink,
  Title,
  When,
} from '../parts';
import { useRead } from '../state';
import { Data } from './motion';
import { SegmentAdministration } from './segment_administration';
import { sessionOf } from './session';
import { DataTable, type Column } from '../table';

// The name of the table that is for all groups together.
const kJoint = 'joint';

// Describes the last entry of the table, or states that there is none.
function worstOf(table: Table): string {
  const last = table.entries[table.entries.length - 1] as Table_Entry | undefined;
  if (!last) return 'the table is empty now';
  return `the entropy of its worst entry is now ${number(last.entropyNats, 4)}`;
}

function Rival(props: { of: TableExclusion; none: string }) {
  return props.of.rival ? <SegmentLink name={props.of.rival} /> : <>{props.none}</>;
}

// Explains an exclusion. Entropies are shown only if the table ranks by them.
function Exclusion(props: { of: TableExclusion; table: Table; entropy: number | undefined }) {
  const { of, table, entropy } = props;
  const values =
    entropy !== undefined && of.rivalEntropyNats !== undefined
      ? ` (entropy ${number(of.rivalEntropyNats, 4)}, this one ${number(entropy, 4)}; lower is more informative)`
      : '';
  const last = table.entries[table.entries.length - 1] as Table_Entry | undefined;
  const changed = last?.segment !== of.rival;
  const now = entropy === undefined || !changed ? '' : '; ' + worstOf(table);
  switch (of.cause) {
    case 'OUTRANKED':
      return (
        <>
          not kept: the table was full, and its worst entry, <Rival of={of} none="since dropped" />,
          is more informative{values}
          {now}
        </>
      );
    case 'REPLACED':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when{' '}
          <Rival of={of} none="a segment that was dropped since" /> replaced it{values}
          {now}
        </>
      );
    case 'TOO_OLD':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when it exceeded the age
          limit of the rig's tables
        </>
      );
    case 'DEVICE_CHANGED':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when a device change was
          detected: the segment is from before it
        </>
      );
    case 'DATA_EVICTED':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when its data was evicted for
          newer segments
        </>
      );
    case 'UNUSABLE':
      return <>kept until it was found unusable</>;
    default:
      return <>not kept; {of.reason}</>;
  }
}

// Explains why a table holds a segment or not: as it was recorded or, for
// segments from before this was recorded, as far as the table shows it.
function Why(props: {
  segment: Segment;
  table: Table | undefined;
  exclusion: TableExclusion | undefined;
  entropy?: number; // if the table ranks by it
}) {
  const { table, entropy } = props;
  if (!table) return <>the rig has one table for all groups</>;
  const place = table.entries.findIndex((e) => e.segment === props.segment.name);
  if (place >= 0) {
    return (
      <>
        kept: rank {place + 1} of {table.entries.length}, most informative first; {worstOf(table)}
      </>
    );
  }
  if (props.exclusion) return <Exclusion of={props.exclusion} table={table} entropy={entropy} />;
  const last = table.entries[table.entries.length - 1] as Table_Entry | undefined;
  const full = table.entries.length >= table.capacity;
  if (full && last && entropy !== undefined && entropy >= last.entropyNats) {
    return (
      <>
        not kept: its entropy of {number(entropy, 4)} is above that of all entries; {worstOf(table)}
      </>
    );
  }
  return <>not kept; the reason was not recorded when it was scored</>;
}

function directions(of: UnobservedDirection[]): string {
  return of
    .map((d) =>
      d.parts
        .slice(0, 2)
        .map((p) => component(p.component))
        .join(' with '),
    )
    .join('; ');
}

function Information(props: { of: Segment; tables: Table[] }) {
  if (props.of.scores.length === 0) {
    return (
      <Empty>
        {props.of.state === 'STORED'
          ? 'The segment is waiting to be scored; this page updates when it is.'
          : 'The segment has no score.'}
      </Empty>
    );
  }
  const tables = new Map(props.tables.map((t) => [idOf(t.name), t]));
  const exclusions = new Map(props.of.exclusions.map((e) => [e.group, e]));
  const reason = (group: string, entropy?: number) => (
    <Why
      segment={props.of}
      table={tables.get(group)}
      exclusion={exclusions.get(group)}
      entropy={entropy}
    />
  );
  const columns: Column<GroupScore>[] = [
    { head: 'Group', cell: (score) => score.group, value: (score) => score.group },
    {
      head: 'Gain [nat]',
      cell: (score) => number(score.gainNats, 4),
      value: (score) => score.gainNats,
    },
    {
      head: 'Entropy [nat]',
      cell: (score) => number(score.entropyNats, 4),
      value: (score) => score.entropyNats,
    },
    { head: 'Observable directions', cell: (score) => `${score.rank} of ${score.size}` },
    {
      head: 'In the table of the group',
      cell: (score) => reason(score.group, score.entropyNats),
      wide: true,
    },
    {
      head: 'Unobservable directions',
      cell: (score) => directions(score.unobserved) || 'none',
      wide: true,
    },
  ];
  return (
    <>
      <DataTable caption="Information about each group" columns={columns} items={props.of.scores} />
      {tables.has(kJoint) && <p>For all groups together: {reason(kJoint)}.</p>}
    </>
  );
}

const ratio = (c: SegmentInformation_Component) => c.sigma / c.priorSigma;

const kParameters: Column<SegmentInformation_Component>[] = [
  {
    head: 'Parameter',
    cell: (c) => heading(component(c.component), shownUnit(c.unit).unit),
    value: (c) => component(c.component),
  },
  {
    head: 'Factory tolerance',
    cell: (c) => sigmaText(shownUnit(c.unit).factor * c.priorSigma),
  },
  {
    head: 'Standard deviation with this segment',
    cell: (c) => sigmaText(shownUnit(c.unit).factor * c.sigma),
  },
  {
    head: 'Remaining uncertainty',
    cell: (c) => <Remaining ratio={ratio(c)} of={component(c.component)} />,
    value: ratio,
  },
];

// Information by parameter, the best determined first.
function Parameters(props: { of: SegmentInformation_Component[] }) {
  const sorted = useMemo(() => [...props.of].sort((a, b) => ratio(a) - ratio(b)), [props.of]);
  if (props.of.length === 0) return null;
  return (
    <details>
      <summary>Information of this segment alone about each parameter</summary>
      <DataTable
        caption="Parameters, by the information of this segment alone"
        columns={kParameters}
        items={sorted}
      />
    </details>
  );
}

export function SegmentPage(props: {
  rig: string;
  caller: Caller | null;
  segment: string;
  version: number;
}) {
  const [changed, setChanged] = useState(0);
  const path = `${rigPath(props.rig)}/segments/${encodeURIComponent(props.segment)}`;
  const read = useRead<Segment>(path, props.version + changed);
  const tables = useRead<ListTablesResponse>(rigPath(props.rig) + '/tables', props.version);
  const information = useRead<SegmentInformation>(path + '/information', props.version);
  const title = 'Segment ' + decodeURIComponent(props.segment);
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {(segment) => (
          <>
            <Figures
              of={[
                ['State', <Badge state={segment.state} />],
                ['Received', <When time={segment.receiveTime} />],
                [
                  'Duration',
                  number(Number(BigInt(segment.endNs) - BigInt(segment.startNs)) / 1e9) + ' s',
                ],
                ['Keyframes', segment.keyframes],
                ['IMU samples', segment.imuSamples],
                ['Landmarks', segment.landmarks],
                ['Observations', segment.observations],
                ['Data', segment.hasData ? bytes(segment.payloadBytes) : 'dropped'],
                segment.temperatureC === undefined
                  ? null
                  : ['Temperature', number(segment.temperatureC) + ' °C'],
                segment.motion?.angularRate === undefined
                  ? null
                  : [
                      'Angular rate (root mean square)',
                      number(segment.motion.angularRate) + ' rad/s',
                    ],
                segment.motion?.acceleration === undefined
                  ? null
                  : [
                      'Acceleration (root mean square)',
                      number(segment.motion.acceleration) + ' m/s²',
                    ],
              ]}
            />
            {segment.problem && <p class="warning">{segment.problem}</p>}
            <h2>Information</h2>
            <Information of={segment} tables={tables.value?.tables ?? []} />
            <Parameters of={information.value?.components ?? []} />
            {segment.residuals && (
              <Figures
                of={[
                  [
                    'Reprojection error (root mean square)',
                    number(segment.residuals.reprojectionRmsPx) + ' px',
                  ],
                  [
                    'Reprojection error (median)',
                    number(segment.residuals.reprojectionMedianPx) + ' px',
                  ],
                  ['Inliers', `${segment.residuals.inliers} of ${segment.residuals.observations}`],
                  ['Outliers', segment.residuals.outliers],
                ]}
              />
            )}
            <h2>Motion</h2>
            <Data rig={props.rig} path={path} segment={segment} />
            <h2>Origin</h2>
            <p>
              Segment number {segment.sequence} of{' '}
              <Link to={'/rigs/' + props.rig}>{props.rig}</Link>, from the session{' '}
              <NameLink name={`rigs/${props.rig}/sessions/${sessionOf(segment.name)}`}>
                {decodeURIComponent(sessionOf(segment.name))}
              </NameLink>
              , estimated with{' '}
              <Link to={pageOf(`rigs/${props.rig}/calibrations/${segment.calibrationVersion}`)}>
                version {segment.calibrationVersion}
              </Link>
              .
            </p>
            {mayAdminister(props.caller, 'rigs/' + props.rig) && (
              <SegmentAdministration
                of={segment}
                version={props.version}
                onChange={() => setChanged(changed + 1)}
              />
            )}
          </>
        )}
      </Loaded>
    </>
  );
}
