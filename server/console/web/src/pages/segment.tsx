import { useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import {
  idOf,
  pageOf,
  rigPath,
  type Direction,
  type Segment,
  type SegmentData,
  type Table,
} from '../api';
import { bytes, component, number } from '../format';
import { Badge, DataTable, Empty, Figures, Link, Loaded, Title, When } from '../parts';
import { kColours, Plot } from '../plot';
import { useRead } from '../state';
import { Tracks, Trajectory } from './motion';

type Score = Segment['scores'][number];

// Why a table holds a segment, or does not, as far as the table tells.
function why(score: Score, table: Table | undefined, segment: Segment): string {
  if (!table) return '';
  const worst = Math.max(...table.entries.map((e) => e.entropyNats));
  const place = table.entries.findIndex((e) => e.segment === segment.name);
  if (score.inTable) {
    return `kept: place ${place + 1} of ${table.entries.length}, richest first`;
  }
  const full = table.entries.length >= table.capacity;
  if (full && score.entropyNats >= worst) {
    return `not kept: all ${table.entries.length} in the table say more (entropy at most ${number(worst, 4)})`;
  }
  return 'not kept: it says too little beyond the prior, or left the table by its age or a change of the device';
}

function directions(of: Direction[]): string {
  return of
    .map((d) => d.parts.slice(0, 2).map((p) => component(p.component)).join(' with '))
    .join('; ');
}

function Information(props: { of: Segment; tables: Table[] }) {
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
  return (
    <>
      <DataTable
        caption="What it says about each group"
        head={['Group', 'Gain [nats]', 'Entropy [nats]', 'Rank', 'Kept?', 'Does not show']}
        rows={props.of.scores.map((score) => [
          score.group,
          number(score.gainNats, 4),
          number(score.entropyNats, 4),
          `${score.rank} of ${score.size}`,
          why(score, tables.get(score.group), props.of),
          directions(score.unobserved) || 'nothing is missing',
        ])}
      />
    </>
  );
}

// Values of one kind, three of each sample, against seconds.
function triple(t: string[], values: number[]): uPlot.AlignedData {
  const start = BigInt(t[0]);
  const at = (offset: number) => t.map((_, i) => values[3 * i + offset]);
  return [
    t.map((time) => Number(BigInt(time) - start) / 1e9),
    at(0),
    at(1),
    at(2),
  ] as uPlot.AlignedData;
}

const kAxes = ['x', 'y', 'z'].map((label, i) => ({
  label,
  stroke: kColours[i],
  width: 1,
}));

function nearest(times: string[], wanted: bigint): number {
  let best = 0;
  let least: bigint | null = null;
  times.forEach((time, i) => {
    const d = BigInt(time) - wanted;
    const distance = d < 0n ? -d : d;
    if (least === null || distance < least) {
      least = distance;
      best = i;
    }
  });
  return best;
}

function Motion(props: { data: SegmentData }) {
  const { imu, keyframes, observations } = props.data;
  const [at, setAt] = useState(0);
  const gyro = useMemo(() => triple(imu.tNs, imu.gyro), [props.data]);
  const accel = useMemo(() => triple(imu.tNs, imu.accel), [props.data]);
  const keyframe = nearest(keyframes.tNs, BigInt(imu.tNs[at]));
  const seconds = (gyro[0][at] as number).toFixed(3);
  return (
    <>
      <label class="scrubber">
        Time: {seconds} s, keyframe {keyframe + 1} of {keyframes.tNs.length}
        <input
          type="range"
          min={0}
          max={imu.tNs.length - 1}
          value={at}
          onInput={(event) => setAt(Number(event.currentTarget.value))}
        />
      </label>
      <div class="side">
        <Trajectory positions={keyframes.pGi} at={keyframe} />
        <Tracks of={observations} at={keyframe} />
      </div>
      <Plot label="Angular rates of the gyroscope" data={gyro} series={kAxes}
        x={{ label: 'seconds' }} y="gyro [rad/s]" cursor={at} onCursor={setAt} height={200} />
      <Plot label="Readings of the accelerometer" data={accel} series={kAxes}
        x={{ label: 'seconds' }} y="accel [m/s²]" cursor={at} onCursor={setAt} height={200} />
    </>
  );
}

function Data(props: { path: string; segment: Segment }) {
  const read = useRead<SegmentData>(props.segment.hasData ? props.path + '/data' : null);
  if (!props.segment.hasData) {
    return (
      <Empty>
        Its data was dropped
        {props.segment.problem ? `: ${props.segment.problem}` : ', for no table and no run needs it'}
        . What it says about the calibration is kept.
      </Empty>
    );
  }
  return (
    <Loaded read={read}>
      {(data) =>
        data.imu.tNs.length === 0 ? (
          <Empty>It has no IMU samples.</Empty>
        ) : (
          <Motion data={data} />
        )
      }
    </Loaded>
  );
}

export function SegmentPage(props: { rig: string; segment: string; version: number }) {
  const path = `${rigPath(props.rig)}/segments/${encodeURIComponent(props.segment)}`;
  const read = useRead<Segment>(path, props.version);
  const tables = useRead<{ tables: Table[] }>(rigPath(props.rig) + '/tables', props.version);
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
            <Information of={segment} tables={tables.value?.tables ?? []} />
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
            <Data path={path} segment={segment} />
            <h2>Where it comes from</h2>
            <p>
              Number {segment.sequence} of <Link to={'/rigs/' + props.rig}>{props.rig}</Link>,
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
