// Paths in space, seen from a direction that the user chooses.
import type { ComponentChildren } from 'preact';
import { useMemo, useState } from 'preact/hooks';

const kSize = 320;
const kMargin = 24;
const kDegree = Math.PI / 180;

// Pieces of a path with the same style; x, y, z in turn.
export interface Strand {
  lines: number[][];
  class: string;
}

// A marked point.
export interface Mark {
  at: number[]; // x, y, z
  class: string;
  radius: number;
  title?: string;
}

interface View {
  turn: number; // degrees
  tilt: number;
}

// Coordinates in the picture, to the right and down, in metres.
function project(x: number, y: number, z: number, view: View): [number, number] {
  const [c, s] = [Math.cos(view.turn * kDegree), Math.sin(view.turn * kDegree)];
  const [ct, st] = [Math.cos(view.tilt * kDegree), Math.sin(view.tilt * kDegree)];
  return [c * x - s * y, -(ct * z + st * (s * x + c * y))];
}

interface Fit {
  scale: number; // pixels per metre
  place: (at: number[], i?: number) => [number, number];
}

// Chooses the scale so that everything is in the picture.
function fit(strands: Strand[], view: View, width: number, height: number): Fit {
  let [left, right, top, bottom] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const { lines } of strands) {
    for (const line of lines) {
      for (let i = 0; i + 2 < line.length; i += 3) {
        const [x, y] = project(line[i], line[i + 1], line[i + 2], view);
        left = Math.min(left, x);
        right = Math.max(right, x);
        top = Math.min(top, y);
        bottom = Math.max(bottom, y);
      }
    }
  }
  const [wide, high] = [Math.max(0, right - left), Math.max(0, bottom - top)];
  const scale = Math.min(
    (width - 2 * kMargin) / (wide || 1e-3),
    (height - 2 * kMargin) / (high || 1e-3),
  );
  const dx = (width - scale * wide) / 2 - scale * left;
  const dy = (height - scale * high) / 2 - scale * top;
  return {
    scale,
    place: (at, i = 0) => {
      const [x, y] = project(at[i], at[i + 1], at[i + 2], view);
      return [dx + scale * x, dy + scale * y];
    },
  };
}

function drawn(lines: number[][], place: Fit['place']): string {
  let path = '';
  for (const line of lines) {
    for (let i = 0; i + 2 < line.length; i += 3) {
      const [x, y] = place(line, i);
      path += `${i === 0 ? 'M' : 'L'}${x.toFixed(1)} ${y.toFixed(1)}`;
    }
  }
  return path;
}

// The length of the scale bar: a round number of metres that is a good part of
// the picture.
function rod(scale: number, width: number): number {
  const most = (width - 2 * kMargin) / 2 / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((k) => k * power).find((length) => length <= most) ?? power;
}

function length(metres: number): string {
  if (metres >= 1) return `${metres} m`;
  return `${Number((metres * 1000).toPrecision(1))} mm`;
}

// `onPoint` gets the index of the target nearest to the pointer.
export function Scene(props: {
  label: string;
  strands: Strand[];
  marks: Mark[];
  children: ComponentChildren; // the caption
  width?: number;
  height?: number;
  targets?: number[][];
  onPoint?: (target: number) => void;
  onPick?: () => void;
}) {
  const [view, setView] = useState<View>({ turn: 30, tilt: 35 });
  const width = props.width ?? kSize;
  const height = props.height ?? kSize;
  const seen = useMemo(
    () => fit(props.strands, view, width, height),
    [props.strands, view, width, height],
  );
  const paths = useMemo(
    () => props.strands.map(({ lines }) => drawn(lines, seen.place)),
    [props.strands, seen],
  );
  const places = useMemo(() => props.marks.map(({ at }) => seen.place(at)), [props.marks, seen]);
  const point = (event: PointerEvent) => {
    const frame = (event.currentTarget as SVGSVGElement).getScreenCTM()?.inverse();
    if (!frame) return;
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(frame);
    let [best, least] = [-1, Infinity];
    props.targets?.forEach((target, i) => {
      const [px, py] = seen.place(target);
      const square = (px - x) ** 2 + (py - y) ** 2;
      if (square < least) [best, least] = [i, square];
    });
    if (best >= 0) props.onPoint?.(best);
  };
  const metres = rod(seen.scale, width);
  const slider = (name: keyof View, says: string, most: number) => (
    <label>
      {says}
      <input
        type="range"
        min={-most}
        max={most}
        value={view[name]}
        onInput={(event) => setView({ ...view, [name]: Number(event.currentTarget.value) })}
      />
    </label>
  );
  return (
    <figure>
      <svg
        viewBox={`0 0 ${width} ${height}`}
        role="img"
        aria-label={props.label}
        onPointerMove={props.onPoint && point}
        onClick={props.onPick}
      >
        {props.strands.map((strand, i) => (
          <path key={i} d={paths[i]} class={'strand ' + strand.class} />
        ))}
        {props.marks.map((mark, i) => (
          <circle key={i} cx={places[i][0]} cy={places[i][1]} r={mark.radius} class={mark.class}>
            {mark.title && <title>{mark.title}</title>}
          </circle>
        ))}
        <line
          x1={kMargin}
          x2={kMargin + seen.scale * metres}
          y1={height - 8}
          y2={height - 8}
          class="rod"
        />
        <text x={kMargin} y={height - 13}>
          {length(metres)}
        </text>
      </svg>
      <figcaption>
        {props.children}
        {slider('turn', 'Turn', 180)}
        {slider('tilt', 'Tilt', 90)}
        <button type="button" onClick={() => setView({ turn: 0, tilt: 90 })}>
          From above
        </button>
        <button type="button" onClick={() => setView({ turn: 0, tilt: 0 })}>
          From the side
        </button>
      </figcaption>
    </figure>
  );
}
