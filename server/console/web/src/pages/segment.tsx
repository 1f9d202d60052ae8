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

// The one table of a rig that chooses for all groups together.
const kJoint = 'joint';

type Score = Segment['scores'][number];
type Entry = Table['entries'][number];

// What the last entry of the table has, or why there is none to compare with.
function worstOf(table: Table): string {
  const last = table.entries[table.entries.length - 1] as Entry | undefined;
  if (!last) return 'the table is empty now';
  return `the worst that it holds now has ${number(last.entropyNats, 4)}`;
}

function Rival(props: { of: Absence; none: string }) {
  return props.of.rival ? <SegmentLink name={props.of.rival} /> : <>{props.none}</>;
}

// Entropies stand only where the table goes by them.
function Gone(props: { of: Absence; table: Table; entropy: number | undefined }) {
  const { of, table, entropy } = props;
  const values =
    entropy !== undefined && of.rivalEntropyNats !== undefined
      ? ` (entropy ${number(of.rivalEntropyNats, 4)}, this one ${number(entropy, 4)}; lower says more)`
      : '';
  const last = table.entries[table.entries.length - 1] as Entry | undefined;
  const changed = last?.segment !== of.rival;
  const now = entropy === undefined || !changed ? '' : '; ' + worstOf(table);
  switch (of.cause) {
    case 'SAYS_TOO_LITTLE':
      return <>not kept: it adds too little to what is known without it</>;
    case 'OTHERS_SAY_MORE':
      return (
        <>
          not kept: the table was full, and its worst, <Rival of={of} none="since dropped" />, said
          more{values}
          {now}
        </>
      );
    case 'PUSHED_OUT':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when{' '}
          <Rival of={of} none="a segment that is since dropped" /> took its place{values}
          {now}
        </>
      );
    case 'TOO_OLD':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when it was older than the
          rig's tables may hold
        </>
      );
    case 'DEVICE_CHANGED':
      return (
        <>
          kept until <time dateTime={of.time}>{clock(of.time)}</time>, when the device was found to
          have changed: it speaks of the device before
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
          excluded: it does not fit; its residuals are {number(of.fit ?? 0)} times what is expected, and
          up to {number(of.fitLimit ?? 0)} is usual for this rig
        </>
      );
    case 'MANY_OUTLIERS':
      return <>excluded: more than a fifth of its observations are outliers</>;
    default:
      return <>not kept</>;
  }
}

// Why a table holds a segment, or does not: as it was written down, or for
// segments from before that, as far as the table tells.
function Why(props: {
  segment: Segment;
  table: Table | undefined;
  absence: Absence | undefined;
  entropy?: number; // where the table goes by it
}) {
  const { table, entropy } = props;
  if (!table) return <>the rig chooses for all groups together</>;
  const place = table.entries.findIndex((e) => e.segment === props.segment.name);
  if (place >= 0) {
    return (
      <>
        kept: place {place + 1} of {table.entries.length}, richest first; {worstOf(table)}
      </>
    );
  }
  if (props.absence) return <Gone of={props.absence} table={table} entropy={entropy} />;
  const last = table.entries[table.entries.length - 1] as Entry | undefined;
  const full = table.entries.length >= table.capacity;
  if (full && last && entropy !== undefined && entropy >= last.entropyNats) {
    return (
      <>
        not kept: its entropy of {number(entropy, 4)} is above that of all in the table;{' '}
        {worstOf(table)}
      </>
    );
  }
  return <>not kept; why was not written down when it was scored</>;
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
          ? 'It waits for its score; this page shows it when it is there.'
          : 'It has no score.'}
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
    directions(score.unobserved) || 'nothing is missing',
  ];
  return (
    <>
      <DataTable
        caption="What it says about each group"
        head={['Group', 'Gain [nats]', 'Entropy [nats]', 'Rank', 'Kept?', 'Does not show']}
        rows={props.of.scores.map(row)}
      />
      {tables.has(kJoint) && <p>Of all groups together: {reason(kJoint)}.</p>}
    </>
  );
}

// By parameter, the ones that it says most about first.
function Parameters(props: { of: ComponentInformation[] }) {
  if (props.of.length === 0) return null;
  const ratio = (c: ComponentInformation) => c.sigma / c.priorSigma;
  const unit = (c: ComponentInformation) => (c.unit === '-' ? '' : ` [${c.unit}]`);
  return (
    <details>
      <summary>What it says alone about each parameter</summary>
      <DataTable
        caption="What this segment alone says about each parameter"
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
            <h2>What it says</h2>
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
            <h2>Where it comes from</h2>
            <p>
              Number {segment.sequence} of <Link to={'/rigs/' + props.rig}>{props.rig}</Link>,
              of the session{' '}
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
