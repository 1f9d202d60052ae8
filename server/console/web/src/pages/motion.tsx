// A segment at one point in time: the position of the device, the observations of
// its cameras, the readings of its IMU, and the residuals.
import { useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import { rigPath } from '../api';
import type { Calibration, MotionSegment, Rig, Segment, SegmentResiduals } from '../contract';
import { kDegrees } from '../format';
import { Choice, Empty, Loaded } from '../parts';
import { kColours, Plot } from '../plot';
import { Residuals } from '../residuals';
import { drawable, type SegmentData } from '../segment_data';
import { useRead } from '../state';
import { Scene, type Mark, type Strand } from '../trajectory';

const place = (positions: number[], i: number) => positions.slice(3 * i, 3 * i + 3);

function Trajectory(props: { positions: number[]; at: number }) {
  const { positions } = props;
  const strands = useMemo((): Strand[] => [{ lines: [positions], class: 'path' }], [positions]);
  const keyframes = useMemo(
    () =>
      Array.from({ length: positions.length / 3 }, (_, i): Mark => ({
        at: place(positions, i),
        class: 'keyframe',
        radius: 2.5,
      })),
    [positions],
  );
  return (
    <Scene
      label="Path of the IMU through the segment"
      strands={strands}
      marks={[...keyframes, { at: place(positions, props.at), class: 'now', radius: 6 }]}
    >
      Path of the IMU.
    </Scene>
  );
}

interface Point {
  observation: number;
  keyframe: number;
  x: number;
  y: number;
}

// The observations of a camera, by landmark.
function tracksOf(of: SegmentData['observations'], camera: number): Map<number, Point[]> {
  const tracks = new Map<number, Point[]>();
  of.camera.forEach((c, i) => {
    if (c !== camera) return;
    const point = {
      observation: i,
      keyframe: of.keyframe[i],
      x: of.zPx[2 * i],
      y: of.zPx[2 * i + 1],
    };
    const track = tracks.get(of.landmark[i]);
    if (track) track.push(point);
    else tracks.set(of.landmark[i], [point]);
  });
  return tracks;
}

// Rounds x down to 1, 2 or 5 times a power of ten.
function round(x: number): number {
  const power = 10 ** Math.floor(Math.log10(x));
  return [5, 2, 1].map((k) => k * power).find((k) => k <= x) ?? power;
}

// The factor by which residuals are enlarged; a typical one is then a fortieth of
// the image wide.
function enlargement(residuals: SegmentResiduals, width: number): number {
  return Math.max(1, round(width / 40 / Math.max(0.01, residuals.reprojectionMedianPx)));
}

// The tracks of one camera: the path of each landmark over the image and, at this
// keyframe, the residual of each observation, drawn from the observed to the
// predicted position.
function Tracks(props: {
  of: SegmentData['observations'];
  at: number;
  camera: number;
  size: { widthPx: number; heightPx: number };
  residuals: SegmentResiduals | null;
}) {
  const { residuals } = props;
  const { widthPx: width, heightPx: height } = props.size;
  const tracks = useMemo(() => tracksOf(props.of, props.camera), [props.of, props.camera]);
  const unused = useMemo(() => new Set(residuals?.unused), [residuals]);
  const scale = residuals ? enlargement(residuals, width) : 1;
  const thin = width / 500;
  const rodPx = round(width / 8 / scale); // length of the scale bar, as a residual
  const vector = (p: Point, colour: string) => {
    const [dx, dy] = residuals!.residualPx.slice(2 * p.observation, 2 * p.observation + 2);
    const out = unused.has(p.observation);
    return (
      <line
        x1={p.x}
        y1={p.y}
        x2={p.x + scale * dx}
        y2={p.y + scale * dy}
        stroke={colour}
        stroke-width={1.6 * thin}
        stroke-dasharray={out ? `${3 * thin} ${3 * thin}` : undefined}
      />
    );
  };
  const place = (p: Point, colour: string) => {
    const r = width / 160;
    return unused.has(p.observation) ? (
      <path
        d={`M${p.x - r} ${p.y - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}`}
        stroke={colour}
        stroke-width={1.6 * thin}
      />
    ) : (
      <circle cx={p.x} cy={p.y} r={r} fill={colour} />
    );
  };
  return (
    <figure>
      <svg
        viewBox={`0 0 ${width} ${height}`}
        class="image"
        role="img"
        aria-label={`Tracks of ${tracks.size} landmarks over the image of camera ${props.camera}, with the residuals of this keyframe`}
      >
        {[...tracks].map(([id, track]) => (
          <polyline
            key={id}
            points={track.map((p) => `${p.x},${p.y}`).join(' ')}
            fill="none"
            stroke={kColours[id % kColours.length]}
            stroke-width={thin}
            stroke-opacity={0.35}
          />
        ))}
        {[...tracks].map(([id, track]) => {
          const now = track.find((p) => p.keyframe === props.at);
          const colour = kColours[id % kColours.length];
          return now ? (
            <g key={id} class="observation">
              {place(now, colour)}
              {residuals && vector(now, colour)}
            </g>
          ) : null;
        })}
        {residuals && (
          <>
            <line
              x1={width / 20}
              x2={width / 20 + scale * rodPx}
              y1={height * 0.97}
              y2={height * 0.97}
              class="rod"
            />
            <text x={width / 20} y={height * 0.955} font-size={width / 32} class="rod-length">
              {rodPx} px of residual
            </text>
          </>
        )}
      </svg>
      <figcaption>
        Tracks over the image; points are the observations of this keyframe
        {residuals &&
          `, with residuals enlarged ${scale} times; crosses and dashed lines are not used in a score`}
      </figcaption>
    </figure>
  );
}

// Vectors of one kind, one per sample, over time in seconds since `start`.
function triple(t: string[], values: number[], start: bigint, factor = 1): uPlot.AlignedData {
  const at = (offset: number) => t.map((_, i) => factor * values[3 * i + offset]);
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

// Menus for the version, the camera and the IMU.
function Choices(props: {
  segment: Segment;
  active: string | undefined;
  version: string;
  onVersion: (version: string) => void;
  cameras: number;
  camera: number;
  onCamera: (camera: number) => void;
  imus: number;
  imu: number;
  onImu: (imu: number) => void;
}) {
  const stated = props.segment.calibrationVersion;
  return (
    <div class="bar">
      <Choice
        label="Residuals at"
        value={props.version}
        of={[
          [stated, `version ${stated}, of the SLAM system`],
          ...(props.active && props.active !== stated
            ? [[props.active, `version ${props.active}, active`] as [string, string]]
            : []),
        ]}
        onChoice={props.onVersion}
      />
      {props.cameras > 1 && (
        <Choice
          label="Camera"
          value={String(props.camera)}
          of={Array.from({ length: props.cameras }, (_, i) => [String(i), String(i)])}
          onChoice={(camera) => props.onCamera(Number(camera))}
        />
      )}
      {props.imus > 1 && (
        <Choice
          label="IMU"
          value={String(props.imu)}
          of={[
            ['0', 'first'],
            ['1', 'second'],
          ]}
          onChoice={(imu) => props.onImu(Number(imu))}
        />
      )}
    </div>
  );
}

function Motion(props: { rig: string; path: string; data: SegmentData; segment: Segment }) {
  const { imu, imu1, keyframes, observations } = props.data;
  const [at, setAt] = useState(0);
  const [camera, setCamera] = useState(0);
  const [chosen, setChosen] = useState(0);
  const [version, setVersion] = useState(props.segment.calibrationVersion);
  const rig = useRead<Rig>(rigPath(props.rig));
  const active = useRead<Calibration>(rigPath(props.rig) + '/calibrations/active');
  const residuals = useRead<SegmentResiduals>(
    `${props.path}/residuals?calibration_version=${version}`,
  );
  // The readings that are shown; `at` is an index into those of the first IMU.
  const shown = chosen === 1 && imu1 ? imu1 : imu;
  // Times are since the first keyframe; readings begin before it.
  const start = BigInt(keyframes.tNs[0]);
  const time = BigInt(imu.tNs[at]);
  const gyro = useMemo(() => triple(shown.tNs, shown.gyro, start, kDegrees), [shown, start]);
  const accel = useMemo(() => triple(shown.tNs, shown.accel, start), [shown, start]);
  const cursor = shown === imu ? at : nearest(shown.tNs, time);
  const toSample = (i: number) => setAt(shown === imu ? i : nearest(imu.tNs, BigInt(shown.tNs[i])));
  const keyframe = nearest(keyframes.tNs, time);
  const toKeyframe = (k: number) => setAt(nearest(imu.tNs, BigInt(keyframes.tNs[k])));
  const secondsOf = (t: bigint) => Number(t - start) / 1e9;
  const range: [number, number] = [
    secondsOf(BigInt(imu.tNs[0])),
    secondsOf(BigInt(imu.tNs[imu.tNs.length - 1])),
  ];
  const cameras = rig.value?.factory?.cameras;
  return (
    <>
      <label class="scrubber">
        Time: {secondsOf(time).toFixed(3)} s, keyframe {keyframe + 1} of {keyframes.tNs.length}
        <input
          type="range"
          min={0}
          max={imu.tNs.length - 1}
          value={at}
          onInput={(event) => setAt(Number(event.currentTarget.value))}
        />
      </label>
      <Choices
        segment={props.segment}
        active={active.value?.version}
        version={version}
        onVersion={setVersion}
        cameras={cameras?.length ?? 1}
        camera={camera}
        onCamera={setCamera}
        imus={imu1 ? 2 : 1}
        imu={chosen}
        onImu={setChosen}
      />
      <div class="side">
        <Trajectory positions={keyframes.pGi} at={keyframe} />
        {cameras && (
          <Tracks
            of={observations}
            at={keyframe}
            camera={camera}
            size={cameras[camera]}
            residuals={residuals.value}
          />
        )}
      </div>
      <Plot
        label="Angular rates of the gyroscope"
        data={gyro}
        series={kAxes}
        x={{ label: 'time [s]' }}
        y="angular rate [°/s]"
        cursor={cursor}
        onCursor={toSample}
        height={200}
      />
      <Plot
        label="Readings of the accelerometer"
        data={accel}
        series={kAxes}
        x={{ label: 'time [s]' }}
        y="acceleration [m/s²]"
        cursor={cursor}
        onCursor={toSample}
        height={200}
      />
      <h2>Residuals</h2>
      <Loaded read={residuals}>
        {(value) => (
          <Residuals
            data={props.data}
            residuals={value}
            keyframe={keyframe}
            onKeyframe={toKeyframe}
            camera={camera}
            imu={chosen}
            range={range}
          />
        )}
      </Loaded>
    </>
  );
}

export function Data(props: { rig: string; path: string; segment: Segment }) {
  const read = useRead<MotionSegment>(props.segment.hasData ? props.path + '/data' : null);
  const data = useMemo(() => read.value && drawable(read.value), [read.value]);
  if (!props.segment.hasData) {
    return (
      <Empty>
        Its data was dropped
        {props.segment.problem
          ? `: ${props.segment.problem}`
          : ', because no table and no run needs it'}
        . Its information about the calibration is kept, and its path is shown with that of its
        session.
      </Empty>
    );
  }
  return (
    <Loaded read={read}>
      {() =>
        data ? (
          <Motion rig={props.rig} path={props.path} data={data} segment={props.segment} />
        ) : (
          <Empty>The segment has no keyframes or no IMU samples.</Empty>
        )
      }
    </Loaded>
  );
}
