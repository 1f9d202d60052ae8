// Where the device went, and what its cameras saw, at one time of a segment.
import { useMemo, useState } from 'preact/hooks';
import type { SegmentData } from '../api';
import { kColours } from '../plot';

const kSize = 320;
const kMargin = 24;
const kDegree = Math.PI / 180;

interface Point {
  x: number;
  y: number;
}

// Seen from a side, and from above by the tilt.
function project(positions: number[], turn: number, tilt: number): Point[] {
  const points: Point[] = [];
  const [c, s] = [Math.cos(turn * kDegree), Math.sin(turn * kDegree)];
  const [ct, st] = [Math.cos(tilt * kDegree), Math.sin(tilt * kDegree)];
  for (let i = 0; i + 2 < positions.length; i += 3) {
    const [x, y, z] = positions.slice(i, i + 3);
    points.push({ x: c * x - s * y, y: -(ct * z + st * (s * x + c * y)) });
  }
  return points;
}

function fitted(points: Point[]): { points: Point[]; scale: number } {
  const xs = points.map((p) => p.x);
  const ys = points.map((p) => p.y);
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const width = Math.max(...xs) - left;
  const height = Math.max(...ys) - top;
  const scale = (kSize - 2 * kMargin) / (Math.max(width, height) || 1);
  const dx = (kSize - scale * width) / 2;
  const dy = (kSize - scale * height) / 2;
  return {
    points: points.map((p) => ({
      x: dx + scale * (p.x - left),
      y: dy + scale * (p.y - top),
    })),
    scale,
  };
}

// A round length that is a good part of the picture.
function rod(scale: number): number {
  const most = (kSize - 2 * kMargin) / 2 / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((k) => k * power).find((length) => length <= most) ?? power;
}

export function Trajectory(props: { positions: number[]; at: number }) {
  const [turn, setTurn] = useState(30);
  const [tilt, setTilt] = useState(35);
  const { points, scale } = useMemo(
    () => fitted(project(props.positions, turn, tilt)),
    [props.positions, turn, tilt],
  );
  const length = rod(scale);
  const now = points[props.at];
  const slider = (name: string, value: number, most: number, set: (v: number) => void) => (
    <label>
      {name}
      <input
        type="range"
        min={-most}
        max={most}
        value={value}
        onInput={(event) => set(Number(event.currentTarget.value))}
      />
    </label>
  );
  return (
    <figure>
      <svg viewBox={`0 0 ${kSize} ${kSize}`} role="img" aria-label="Trajectory of the IMU">
        <polyline points={points.map((p) => `${p.x},${p.y}`).join(' ')} class="path" />
        {points.map((p, i) => (
          <circle key={i} cx={p.x} cy={p.y} r={2.5} class="keyframe" />
        ))}
        {now && <circle cx={now.x} cy={now.y} r={6} class="now" />}
        <line x1={kMargin} x2={kMargin + scale * length} y1={kSize - 8} y2={kSize - 8} class="rod" />
        <text x={kMargin} y={kSize - 13}>
          {length >= 1 ? `${length} m` : `${Math.round(length * 1000)} mm`}
        </text>
      </svg>
      <figcaption>
        Trajectory
        {slider('Turn', turn, 180, setTurn)}
        {slider('Tilt', tilt, 90, setTilt)}
      </figcaption>
    </figure>
  );
}

// Of one camera: each landmark's way over the image, and where it is now.
export function Tracks(props: { of: SegmentData['observations']; at: number }) {
  const { camera, landmark, keyframe, zPx } = props.of;
  const cameras = useMemo(() => [...new Set(camera)].sort((a, b) => a - b), [props.of]);
  const [chosen, setChosen] = useState(0);
  const { tracks, width, height } = useMemo(() => {
    const tracks = new Map<number, { keyframe: number; x: number; y: number }[]>();
    let [width, height] = [1, 1];
    camera.forEach((c, i) => {
      if (c !== (cameras[chosen] ?? 0)) return;
      const [x, y] = [zPx[2 * i], zPx[2 * i + 1]];
      width = Math.max(width, x);
      height = Math.max(height, y);
      const track = tracks.get(landmark[i]) ?? [];
      track.push({ keyframe: keyframe[i], x, y });
      tracks.set(landmark[i], track);
    });
    return { tracks, width: Math.ceil(width), height: Math.ceil(height) };
  }, [props.of, chosen]);
  return (
    <figure>
      <svg
        viewBox={`0 0 ${width} ${height}`}
        class="image"
        role="img"
        aria-label={`Tracks of ${tracks.size} landmarks over the image`}
      >
        {[...tracks].map(([id, track]) => (
          <polyline
            key={id}
            points={track.map((p) => `${p.x},${p.y}`).join(' ')}
            fill="none"
            stroke={kColours[id % kColours.length]}
            stroke-width={width / 500}
            stroke-opacity={0.5}
          />
        ))}
        {[...tracks].map(([id, track]) => {
          const now = track.find((p) => p.keyframe === props.at);
          return now ? (
            <circle key={id} cx={now.x} cy={now.y} r={width / 160} fill={kColours[id % kColours.length]} />
          ) : null;
        })}
      </svg>
      <figcaption>
        Tracks over the image; points are those of this keyframe
        {cameras.length > 1 && (
          <label>
            Camera
            <select value={chosen} onChange={(event) => setChosen(Number(event.currentTarget.value))}>
              {cameras.map((c, i) => (
                <option key={c} value={i}>
                  {c}
                </option>
              ))}
            </select>
          </label>
        )}
      </figcaption>
    </figure>
  );
}
