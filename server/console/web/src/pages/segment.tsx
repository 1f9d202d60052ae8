import {
  idOf,
  pageOf,
  rigPath,
  type Absence,
  type ComponentInformation,
  type Direction,
  type Segment,
  type Table,
} from '../api';
import { bytes, clock, component, number } from '../format';
import {
  Badge,
  DataTable,
  Empty,
  Figures,
  Link,
  Loaded,
  SegmentLink,
  Title,
  Unknown,
  When,
} from '../parts';
import { useRead } from '../state';
import { Data } from './motion';
import { sessionOf } from './session';

// The name of the table that is for all groups together.
const kJoint = 'joint';

type Score = Segment['scores'][number];
type Entry = Table['entries'][number];

// Describes the last entry of the table, or states that there is none.
function worstOf(table: Table): string {
  const last = table.entries[table.entries.length - 1] as Entry | undefined;
  if (!last) return 'the table is empty now';
  return `its worst entry now has ${number(last.entropyNats, 4)}`;
}

function Rival(props: { of: Absence; none: string }) {
  return props.of.rival ? <SegmentLink name={props.of.rival} /> : <>{props.none}</>;
}

// Explains an exclusion. Entropies are shown only if the table ranks by them.
function Gone(props: { of: Absence; table: Table; entropy: number | undefined }) {
  const { of, table, entropy } = props;
  const values =
    entropy !== undefined && of.rivalEntropyNats !== undefined
      ? ` (entropy ${number(of.rivalEntropyNats, 4)}, this one ${number(entropy, 4)}; lower is more informative)`
      : '';
  const last = table.entries[table.entries.length - 1] as Entry | undefined;
  const changed = last?.segment !== of.rival;
  const now = entropy === undefined || !changed ? '' : '; ' + worstOf(table);
  switch (of.cause) {
    case 'SAYS_TOO_LITTLE':
      return <>not kept: insufficient gain</>;
    case 'OTHERS_SAY_MORE':
      return (
        <>
          not kept: the table was full, and its worst entry,{' '}
          <Rival of={of} none="since dropped" />, is more informative{values}
          {now}
        </>
      );
    case 'PUSHED_OUT':
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
    case 'DOES_NOT_FIT':
      return (
        <>
          excluded: it does not fit; its residuals are {number(of.fit ?? 0)} times what is expected,
          and up to {number(of.fitLimit ?? 0)} times is usual for this rig
        </>
      );
    case 'MANY_OUTLIERS':
      return <>excluded: more than a fifth of its observations are outliers</>;
    default:
      return <>not kept</>;
  }
}

// Explains why a table holds a segment or not: as it was recorded or, for
// segments from before this was recorded, as far as the table shows it.
function Why(props: {
  segment: Segment;
  table: Table | undefined;
  absence: Absence | undefined;
  entropy?: number; // if the table ranks by it
}) {
  const { table, entropy } = props;
  if (!table) return <>the rig has one table for all groups</>;
  const place = table.entries.findIndex((e) => e.segment === props.segment.name);
  if (place >= 0) {
    return (
      <>
        kept: rank {place + 1} of {table.entries.length}, most informative first;{' '}
        {worstOf(table)}
      </>
    );
  }
  if (props.absence) return <Gone of={props.absence} table={table} entropy={entropy} />;
  const last = table.entries[table.entries.length - 1] as Entry | undefined;
  const full = table.entries.length >= table.capacity;
  if (full && last && entropy !== undefined && entropy >= last.entropyNats) {
    return (
      <>
        not kept: its entropy of {number(entropy, 4)} is above that of all entries;{' '}
        {worstOf(table)}
      </>
    );
  }
  return <>not kept; the reason was not recorded when it was scored</>;
}

function directions(of: Direction[]): string {
  return of
    .map((d) => d.parts.slice(0, 2).map((p) => component(p.component)).join(' with '))
    .join('; ');
}

function Information(props: { of: Segment; tables: Table[]; absences: Absence[] }) {
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
  const absences = new Map(props.absences.map((a) => [a.group, a]));
  const reason = (group: string, entropy?: number) => (
    <Why
      segment={props.of}
      table={tables.get(group)}
      absence={absences.get(group)}
      entropy={entropy}
    />
  );
  const row = (score: Score) => [
    score.group,
    number(score.gainNats, 4),
    number(score.entropyNats, 4),
    `${score.rank} of ${score.size}`,
    reason(score.group, score.entropyNats),
    directions(score.unobserved) || 'none',
  ];
  return (
    <>
      <DataTable
        caption="Information about each group"
        head={['Group', 'Gain [nats]', 'Entropy [nats]', 'Rank', 'Kept?', 'Unobservable']}
        rows={props.of.scores.map(row)}
      />
      {tables.has(kJoint) && <p>For all groups together: {reason(kJoint)}.</p>}
    </>
  );
}

// Information by parameter, the best determined first.
function Parameters(props: { of: ComponentInformation[] }) {
  if (props.of.length === 0) return null;
  const ratio = (c: ComponentInformation) => c.sigma / c.priorSigma;
  const unit = (c: ComponentInformation) => (c.unit === '-' ? '' : ` [${c.unit}]`);
  return (
    <details>
      <summary>Information of this segment alone about each parameter</summary>
      <DataTable
        caption="Parameters, by the information of this segment alone"
        head={['Parameter', 'Factory tolerance', 'Sigma with it', 'Still unknown']}
        rows={[...props.of]
          .sort((a, b) => ratio(a) - ratio(b))
          .map((c) => [
            component(c.component) + unit(c),
            number(c.priorSigma),
            number(c.sigma),
            <Unknown ratio={ratio(c)} of={component(c.component)} />,
          ])}
      />
    </details>
  );
}

export function SegmentPage(props: { rig: string; segment: string; version: number }) {
  const path = `${rigPath(props.rig)}/segments/${encodeURIComponent(props.segment)}`;
  const read = useRead<Segment>(path, props.version);
  const tables = useRead<{ tables: Table[] }>(rigPath(props.rig) + '/tables', props.version);
  const absences = useRead<{ absences: Absence[] }>(path + '/absences', props.version);
  const information = useRead<{ components: ComponentInformation[] }>(
    path + '/information',
    props.version,
  );
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
                ['Length', number(Number(BigInt(segment.endNs) - BigInt(segment.startNs)) / 1e9) + ' s'],
                ['Keyframes', segment.keyframes],
                ['IMU samples', segment.imuSamples],
                ['Landmarks', segment.landmarks],
                ['Observations', segment.observations],
                ['Data', segment.hasData ? bytes(segment.payloadBytes) : 'dropped'],
                segment.temperatureC === undefined
                  ? null
                  : ['Temperature', number(segment.temperatureC) + ' °C'],
              ]}
            />
            {segment.problem && <p class="warning">{segment.problem}</p>}
            <h2>Information</h2>
            <Information
              of={segment}
              tables={tables.value?.tables ?? []}
              absences={absences.value?.absences ?? []}
            />
            <Parameters of={information.value?.components ?? []} />
            {segment.residuals && (
              <Figures
                of={[
                  ['Reprojection rms', number(segment.residuals.reprojectionRmsPx) + ' px'],
                  ['Median', number(segment.residuals.reprojectionMedianPx) + ' px'],
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
              <Link to={pageOf(`rigs/${props.rig}/sessions/${sessionOf(segment.name)}`)}>
                {decodeURIComponent(sessionOf(segment.name))}
              </Link>
              ,
              estimated with{' '}
              <Link to={pageOf(`rigs/${props.rig}/calibrations/${segment.calibrationVersion}`)}>
                version {segment.calibrationVersion}
              </Link>
              .
            </p>
          </>
        )}
      </Loaded>
    </>
  );
}
