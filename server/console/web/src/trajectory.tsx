// Paths in space, drawn as lines; the reader orbits around them.
import type { ComponentChildren } from 'preact';
import { useMemo, useRef } from 'preact/hooks';
import { useOrbit, type Box, type Project } from './orbit';

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

function boxOf(strands: Strand[]): Box {
  const least = [Infinity, Infinity, Infinity];
  const most = [-Infinity, -Infinity, -Infinity];
  for (const { lines } of strands) {
    for (const line of lines) {
      line.forEach((value, i) => {
        least[i % 3] = Math.min(least[i % 3], value);
        most[i % 3] = Math.max(most[i % 3], value);
      });
    }
  }
  return least.every(Number.isFinite) ? { least, most } : { least: [0, 0, 0], most: [1, 1, 1] };
}

// ------------------------------------------------------------- the grid

// The floor below the path, with a tick at each line, and the height.
interface Grid {
  step: number; // metres
  ticks: number[][]; // of x, y and z
}

const kMostLines = 8;

// A step of 1, 2 or 5 times a power of ten; the ends are ticks beyond the path.
function gridOf({ least, most }: Box): Grid {
  const size = Math.max(1e-3, ...[0, 1, 2].map((i) => most[i] - least[i]));
  const power = 10 ** Math.floor(Math.log10(size / kMostLines));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => size / s <= kMostLines)!;
  const ticks = [0, 1, 2].map((i) => {
    const from = Math.floor(least[i] / step);
    const to = Math.max(from + 1, Math.ceil(most[i] / step));
    return Array.from({ length: to - from + 1 }, (_, k) => (from + k) * step);
  });
  return { step, ticks };
}

const ends = (ticks: number[]) => [ticks[0], ticks[ticks.length - 1]];

function gridLines({ ticks: [xs, ys, zs] }: Grid): number[][] {
  const [[x0, x1], [y0, y1], [z0, z1]] = [ends(xs), ends(ys), ends(zs)];
  return [
    ...xs.map((x) => [x, y0, z0, x, y1, z0]),
    ...ys.map((y) => [x0, y, z0, x1, y, z0]),
    [x0, y1, z0, x0, y1, z1],
  ];
}

interface Label {
  at: number[];
  text: string;
  // The point from which the text is moved away.
  from: number[];
}

function gridLabels({ step, ticks: [xs, ys, zs] }: Grid): Label[] {
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const [[x0, x1], [y0, y1], [z0]] = [ends(xs), ends(ys), ends(zs)];
  const middle = [(x0 + x1) / 2, (y0 + y1) / 2, z0];
  const text = (value: number) => value.toFixed(decimals).replace(/^-(0(\.0*)?)$/, '$1');
  const named = (ticks: number[], name: string, place: (value: number) => number[]): Label[] =>
    ticks.map((value, i) => ({
      at: place(value),
      text: i === ticks.length - 1 ? `${name} ${text(value)} m` : text(value),
      from: middle,
    }));
  return [
    ...named(xs, 'x', (x) => [x, y0, z0]),
    ...named(ys.slice(1), 'y', (y) => [x1, y, z0]),
    ...named(zs.slice(1), 'z', (z) => [x0, y1, z]),
  ];
}

const kAway = 14; // pixels between a tick and its text

function Labels(props: { of: Label[]; project: Project }) {
  return (
    <g class="ticks">
      {props.of.map(({ at, text, from }, i) => {
        const place = props.project(at[0], at[1], at[2]);
        const centre = props.project(from[0], from[1], from[2]);
        if (!place || !centre) return null;
        const [dx, dy] = [place[0] - centre[0], place[1] - centre[1]];
        const length = Math.hypot(dx, dy) || 1;
        return (
          <text
            key={i}
            x={place[0] + (kAway * dx) / length}
            y={place[1] + (kAway * dy) / length}
            text-anchor="middle"
            dominant-baseline="middle"
          >
            {text}
          </text>
        );
      })}
    </g>
  );
}

// ------------------------------------------------------------- the picture

function drawn(lines: number[][], project: Project): string {
  let path = '';
  for (const line of lines) {
    let joined = false;
    for (let i = 0; i + 2 < line.length; i += 3) {
      const place = project(line[i], line[i + 1], line[i + 2]);
      if (place) path += `${joined ? 'L' : 'M'}${place[0].toFixed(1)} ${place[1].toFixed(1)}`;
      joined = place !== null;
    }
  }
  return path;
}

const kStill = 4; // a click moves the pointer by fewer pixels

// `onPoint` gets the index of the target nearest to the pointer.
export function Scene(props: {
  label: string;
  strands: Strand[];
  marks: Mark[];
  children: ComponentChildren; // the caption
  targets?: number[][];
  onPoint?: (target: number) => void;
  onPick?: () => void;
}) {
  const holder = useRef<HTMLDivElement>(null);
  const pressed = useRef<[number, number]>([0, 0]);
  const { strands, targets } = props;
  const { grid, labels, box } = useMemo(() => {
    const made = gridOf(boxOf(strands));
    const [xs, ys, zs] = made.ticks.map(ends);
    return {
      grid: gridLines(made),
      labels: gridLabels(made),
      box: { least: [xs[0], ys[0], zs[0]], most: [xs[1], ys[1], zs[1]] },
    };
  }, [strands]);
  const { width, height, project, onKey, look } = useOrbit(holder, box);
  const floor = useMemo(() => drawn(grid, project), [grid, project]);
  const paths = useMemo(
    () => strands.map(({ lines }) => drawn(lines, project)),
    [strands, project],
  );
  const point = (event: PointerEvent) => {
    const { left, top } = holder.current!.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    let [best, least] = [-1, Infinity];
    targets?.forEach((target, i) => {
      const place = project(target[0], target[1], target[2]);
      if (!place) return;
      const square = (place[0] - x) ** 2 + (place[1] - y) ** 2;
      if (square < least) [best, least] = [i, square];
    });
    if (best >= 0) props.onPoint?.(best);
  };
  const pick = (event: MouseEvent) => {
    const [x, y] = pressed.current;
    if (Math.hypot(event.clientX - x, event.clientY - y) < kStill) props.onPick?.();
  };
  return (
    <figure class="scene">
      <div
        ref={holder}
        class="orbit"
        tabIndex={0}
        role="application"
        aria-label={props.label + '; arrow keys rotate, + and - zoom, Home resets the view'}
        onKeyDown={onKey}
        onPointerMove={props.onPoint && point}
        onPointerDown={(event) => (pressed.current = [event.clientX, event.clientY])}
        onClick={pick}
      >
        <svg viewBox={`0 0 ${width} ${height}`} role="img" aria-label={props.label}>
          <path d={floor} class="floor" />
          <Labels of={labels} project={project} />
          {strands.map((strand, i) => (
            <path key={i} d={paths[i]} class={'strand ' + strand.class} />
          ))}
          {props.marks.map((mark, i) => {
            const place = project(mark.at[0], mark.at[1], mark.at[2]);
            return (
              place && (
                <circle key={i} cx={place[0]} cy={place[1]} r={mark.radius} class={mark.class}>
                  {mark.title && <title>{mark.title}</title>}
                </circle>
              )
            );
          })}
        </svg>
      </div>
      <figcaption>
        <span>{props.children} Drag to rotate; click, then scroll to zoom.</span>
        <button type="button" onClick={() => look('corner')}>
          Whole path
        </button>
        <button type="button" onClick={() => look('above')}>
          From above
        </button>
        <button type="button" onClick={() => look('side')}>
          From the side
        </button>
      </figcaption>
    </figure>
  );
}
