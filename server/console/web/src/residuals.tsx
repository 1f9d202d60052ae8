// The residuals of a segment: of its observations and between its keyframes.
import { useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import type { SegmentResiduals, SegmentResiduals_Intervals } from './contract';
import type { SegmentData } from './segment_data';
import { kDegrees, number } from './format';
import { Choice } from './parts';
import { kColours, Plot, type PlotSeries } from './plot';

// A logarithmic axis has no zero.
const kLeast = 1e-3;

interface Shown {
  data: SegmentData;
  residuals: SegmentResiduals;
  keyframe: number;
  range: [number, number]; // of the time axis, as in the plots of the IMU [s]
  onKeyframe: (keyframe: number) => void;
}

// Since the first keyframe.
function secondsOf(times: string[]): number[] {
  const start = BigInt(times[0]);
  return times.map((time) => Number(BigInt(time) - start) / 1e9);
}

const points = (label: string, stroke: string): PlotSeries => ({
  label,
  stroke,
  paths: () => null,
  points: { show: true, size: 4, stroke, fill: stroke },
});

const kObservations = [points('used', kColours[0]), points('excluded', kColours[1])];

// The residuals of one camera, at the times of the keyframes.
function Reprojections(props: Shown & { camera: number }) {
  const { data, keyframes } = useMemo(() => {
    const { observations } = props.data;
    const { residualPx, unused, notProjectable } = props.residuals;
    const [out, none] = [new Set(unused), new Set(notProjectable)];
    const seconds = secondsOf(props.data.keyframes.tNs);
    const chosen = observations.camera
      .map((_, i) => i)
      .filter((i) => observations.camera[i] === props.camera && !none.has(i))
      .sort((a, b) => observations.keyframe[a] - observations.keyframe[b]);
    const size = (i: number) =>
      Math.max(kLeast, Math.hypot(residualPx[2 * i], residualPx[2 * i + 1]));
    return {
      data: [
        chosen.map((i) => seconds[observations.keyframe[i]]),
        chosen.map((i) => (out.has(i) ? null : size(i))),
        chosen.map((i) => (out.has(i) ? size(i) : null)),
      ] as uPlot.AlignedData,
      keyframes: chosen.map((i) => observations.keyframe[i]),
    };
  }, [props.data, props.residuals, props.camera]);
  return (
    <Plot
      label={`Reprojection residuals of camera ${props.camera} in pixels, by time`}
      data={data}
      series={kObservations}
      x={{ label: 'time [s]', range: props.range }}
      y="residual [px]"
      log
      height={220}
      cursor={Math.max(0, keyframes.indexOf(props.keyframe))}
      onCursor={(i) => props.onKeyframe(keyframes[i])}
    />
  );
}

// The parts of the residual of an interval, in their order.
const kParts = [
  { name: 'rotation', unit: '°', factor: kDegrees },
  { name: 'velocity', unit: 'm/s', factor: 1 },
  { name: 'position', unit: 'm', factor: 1 },
  { name: 'change of the accelerometer bias', unit: 'm/s²', factor: 1 },
  { name: 'change of the gyroscope bias', unit: '°/s', factor: kDegrees },
];
const kSize = 15;
const kWhitened = 'whitened';

// The lines of biases are dashed.
const kGrey = '#8a929c';
const kKinds: PlotSeries[] = kParts.map((part, i) => ({
  label: part.name,
  stroke: kColours[i] ?? kGrey,
  width: 1.2,
  dash: i > 2 ? [6, 4] : undefined,
}));
const kAxes = ['x', 'y', 'z'].map((label, i) => ({ label, stroke: kColours[i], width: 1.2 }));

function intervalsOf(
  segment: SegmentData,
  intervals: SegmentResiduals_Intervals,
  part: string,
): uPlot.AlignedData {
  const { whitened, residual } = intervals;
  const seconds = secondsOf(segment.keyframes.tNs).slice(0, -1);
  const three = (of: number[], k: number, kind: number) =>
    of.slice(kSize * k + 3 * kind, kSize * k + 3 * kind + 3);
  if (part === kWhitened) {
    const rms = (k: number, kind: number) =>
      Math.sqrt(three(whitened, k, kind).reduce((sum, x) => sum + x * x, 0) / 3);
    return [
      seconds,
      ...kParts.map((_, kind) => seconds.map((_, k) => rms(k, kind))),
    ] as uPlot.AlignedData;
  }
  const kind = Number(part);
  const { factor } = kParts[kind];
  return [
    seconds,
    ...[0, 1, 2].map((axis) => seconds.map((_, k) => factor * three(residual, k, kind)[axis])),
  ] as uPlot.AlignedData;
}

function Intervals(props: Shown & { of: SegmentResiduals_Intervals }) {
  const [part, setPart] = useState(kWhitened);
  const { data: segment, of: intervals } = props;
  const data = useMemo(() => intervalsOf(segment, intervals, part), [segment, intervals, part]);
  const whitened = part === kWhitened;
  const { name, unit } = whitened
    ? { name: 'all, in standard deviations', unit: 'sigmas' }
    : kParts[Number(part)];
  return (
    <>
      <div class="bar">
        <Choice
          label="IMU residuals between keyframes"
          value={part}
          of={[
            [kWhitened, 'all, in standard deviations'],
            ...kParts.map((p, i): [string, string] => [String(i), `${p.name} [${p.unit}]`]),
          ]}
          onChoice={setPart}
        />
      </div>
      <Plot
        key={part}
        label={`IMU residuals of each interval between keyframes: ${name}`}
        data={data}
        series={whitened ? kKinds : kAxes}
        x={{ label: 'time [s]', range: props.range }}
        y={whitened ? 'root mean square [sigmas]' : `residual [${unit}]`}
        height={220}
        cursor={Math.min(props.keyframe, data[0].length - 1)}
        onCursor={props.onKeyframe}
      />
    </>
  );
}

function InWords(props: { of: SegmentResiduals }) {
  const { cameras, inertialRms, imu1InertialRms, calibrationVersion, notProjectable } = props.of;
  const kinds = (rms: number[]) =>
    kParts.map((part, i) => `${part.name} ${number(rms[i] ?? NaN)}`).join(', ');
  return (
    <>
      <ul>
        {cameras.map((c) => (
          <li key={c.camera}>
            Camera {c.camera}: {number(c.inlierRmsPx)} px root mean square over the {c.inliers} of{' '}
            {c.observations} observations that a score uses
            {c.observations > c.inliers && `; ${c.observations - c.inliers} are excluded`}.
          </li>
        ))}
        {notProjectable.length > 0 && (
          <li>{notProjectable.length} observations do not project and have no residual.</li>
        )}
        {inertialRms.length > 0 && (
          <li>IMU, root mean square in standard deviations: {kinds(inertialRms)}.</li>
        )}
        {imu1InertialRms.length > 0 && <li>Second IMU: {kinds(imu1InertialRms)}.</li>}
      </ul>
      <p class="quiet">
        At version {calibrationVersion}, with the states that the client's SLAM system sent;
        landmarks are refined as for a score, everything else is held constant. For the residuals
        after a calibration, see the page of its run.
      </p>
    </>
  );
}

export function Residuals(props: Shown & { camera: number; imu: number }) {
  const { intervals, imu1Intervals } = props.residuals;
  const shown = props.imu === 1 ? imu1Intervals : intervals;
  return (
    <>
      <InWords of={props.residuals} />
      <Reprojections {...props} />
      {shown && <Intervals {...props} of={shown} />}
    </>
  );
}
