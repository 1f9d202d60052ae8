// A plot, drawn by uPlot, that adapts to the width and the colours of the page.
// The pointer or the arrow keys choose a value, which is shown below it.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { number } from './format';

export const kColours = ['#2f6fdb', '#d9822b', '#2a9d6f', '#a64ac9'];
const kFont = '12px system-ui, sans-serif';
const kCharacter = 7; // width, about
const kTimePadding = 36; // to the right, for half of the label of the last tick
const dark = matchMedia('(prefers-color-scheme: dark)');

function ink(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export interface PlotSeries extends uPlot.Series {
  label: string;
}

export interface PlotProps {
  label: string; // a description of the plot
  data: uPlot.AlignedData;
  series: PlotSeries[];
  x: {
    label: string; // with the unit
    integers?: boolean;
    time?: boolean; // in seconds since 1970, shown in UTC
    range?: [number, number];
  };
  y: string; // with the unit
  log?: boolean; // logarithmic y axis; needs values above 0
  bands?: uPlot.Band[];
  height?: number;
  cursor?: number; // index of the value under the cursor
  onCursor?: (index: number) => void;
  // The values at an index in words; by default those of all series.
  describe?: (index: number) => string;
}

// ------------------------------------------------------------- ticks

// Labels only the powers of ten on a logarithmic axis over several decades.
function powers(_: uPlot, values: number[]): (number | null)[] {
  const isPower = (value: number) => {
    const power = Math.log10(value);
    return Math.abs(power - Math.round(power)) < 1e-9;
  };
  return values.filter(isPower).length < 2
    ? values
    : values.map((value) => (isPower(value) ? value : null));
}

const kMostDecimals = 7;

// All ticks of an axis with the same decimals.
function decimalTicks(values: number[], step: number): string[] {
  let decimals = 0;
  const isWhole = (x: number) => Math.abs(x - Math.round(x)) < 1e-6 * Math.max(1, Math.abs(x));
  while (decimals < kMostDecimals && !isWhole(step * 10 ** decimals)) ++decimals;
  const size = Math.max(...values.map(Math.abs));
  if (size >= 1e6 || decimals === kMostDecimals) {
    const digits = Math.ceil(Math.log10(size / step));
    return values.map((value) => (value === 0 ? '0' : value.toExponential(Math.max(0, digits))));
  }
  return values.map((value) => value.toFixed(decimals));
}

const kMinute = 60;
const kHour = 60 * kMinute;
const kDay = 24 * kHour;
const kMonth = 30 * kDay; // uPlot begins these steps at the first of a month
const kYear = 365 * kDay;
const kTimeSteps = [
  ...[0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30],
  ...[1, 2, 5, 10, 15, 30].map((k) => k * kMinute),
  ...[1, 2, 3, 6, 12].map((k) => k * kHour),
  ...[1, 2, 5, 10].map((k) => k * kDay),
  ...[1, 2, 3, 6].map((k) => k * kMonth),
  ...[1, 2, 5, 10].map((k) => k * kYear),
];
const kTimeSpace = 90; // pixels, if that leaves two ticks

function timeStep(range: number, pixels: number): number {
  const wide = kTimeSteps.find((step) => (step * pixels) / range >= kTimeSpace) ?? range;
  const few = kTimeSteps.filter((step) => step <= range / 2).pop() ?? kTimeSteps[0];
  return Math.min(wide, few);
}

// Times in UTC; the date stands where it changes.
function timeTicks(values: number[], step: number): string[] {
  let before = '';
  return values.map((value) => {
    const [date, clock] = new Date(1000 * value).toISOString().split('T');
    const changed = date !== before;
    before = date;
    if (step >= kDay) return date;
    const time = clock.slice(0, step >= kMinute ? 5 : step >= 1 ? 8 : -2);
    return changed ? `${time}\n${date}` : time;
  });
}

function axis(props: PlotProps, which: 'x' | 'y', element: HTMLElement): uPlot.Axis {
  const isX = which === 'x';
  const log = !isX && props.log === true;
  const shown = log ? { filter: powers } : {};
  const format = (values: (number | null)[], step: number): string[] => {
    if (log) return values.map((value) => (value === null ? '' : number(value, 1)));
    const numbers = values as number[];
    return isX && props.x.time ? timeTicks(numbers, step) : decimalTicks(numbers, step);
  };
  return {
    label: isX ? props.x.label : props.y,
    labelSize: 22,
    font: kFont,
    labelFont: kFont,
    stroke: () => ink('--quiet'),
    grid: { stroke: () => ink('--line'), width: 1, ...shown },
    ticks: { stroke: () => ink('--quiet'), width: 1, size: 6, ...shown },
    ...shown,
    // A canvas has no text that can be read: the labels are an attribute, too.
    values: (_, values, __, ___, step) => {
      const labels = format(values, step);
      element.dataset[which + 'Ticks'] = labels.filter(Boolean).join('|').replaceAll('\n', ' ');
      return labels;
    },
    ...(isX
      ? { size: props.x.time ? 44 : 32 }
      : {
          size: (_, labels) =>
            18 + kCharacter * Math.max(3, ...(labels ?? []).map((label) => label.length)),
        }),
    ...(isX && props.x.integers ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000] } : {}),
    ...(isX && props.x.time
      ? { space: 1, incrs: (_, __, least, most, pixels) => [timeStep(most - least, pixels)] }
      : {}),
  };
}

// ------------------------------------------------------------- values

function valuesAt(props: PlotProps, index: number): string {
  const { data, x, series } = props;
  const at = data[0][index];
  const values = series.flatMap((one, i) => {
    const value = data[i + 1][index];
    return value == null ? [] : [`${one.label} ${number(value, 4)}`];
  });
  return `${x.label} ${number(at, 4)}: ${values.join(', ')}`;
}

// Where a key moves the cursor.
function moved(key: string, from: number, count: number): number | null {
  const large = Math.max(1, Math.round(count / 10));
  const to: Record<string, number> = {
    ArrowRight: from + 1,
    ArrowLeft: from - 1,
    PageDown: from + large,
    PageUp: from - large,
    Home: 0,
    End: count - 1,
  };
  return key in to ? Math.min(count - 1, Math.max(0, to[key])) : null;
}

// ------------------------------------------------------------- the plot

export function Plot(props: PlotProps) {
  const holder = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const [chosen, setChosen] = useState<number | null>(null);
  const count = props.data[0].length;
  const at = props.cursor ?? (chosen !== null && chosen < count ? chosen : null);
  const choose = (index: number) => {
    setChosen(index);
    props.onCursor?.(index);
  };
  const onPoint = useRef(choose);
  onPoint.current = choose;
  // The cursor is moved by the page or by the pointer.
  const moving = useRef(false);

  useEffect(() => {
    const element = holder.current!;
    const size = () => ({
      width: Math.max(200, element.clientWidth),
      height: props.height ?? 240,
    });
    const made = new uPlot(
      {
        ...size(),
        padding: [null, props.x.time ? kTimePadding : null, null, null],
        tzDate: (seconds) => uPlot.tzDate(new Date(1000 * seconds), 'Etc/UTC'),
        scales: {
          x: { time: props.x.time === true, range: props.x.range },
          y: props.log ? { distr: 3 } : {},
        },
        axes: [axis(props, 'x', element), axis(props, 'y', element)],
        series: [{}, ...props.series],
        bands: props.bands,
        legend: { show: props.series.length > 1, live: false },
        cursor: { drag: { x: false, y: false } },
        hooks: {
          setCursor: [
            (u) => {
              // uPlot also calls this when the size of the plot changes.
              const pointed = !moving.current && u.over.matches(':hover');
              if (pointed && u.cursor.idx != null) onPoint.current(u.cursor.idx);
            },
          ],
        },
      },
      props.data,
      element,
    );
    plot.current = made;
    const observer = new ResizeObserver(() => made.setSize(size()));
    observer.observe(element);
    const redraw = () => made.redraw();
    dark.addEventListener('change', redraw);
    return () => {
      observer.disconnect();
      dark.removeEventListener('change', redraw);
      made.destroy();
      plot.current = null;
    };
    // Series, axes and bands belong to the data; callers pass new but equal objects.
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [props.data, props.height, props.label]);

  useEffect(() => {
    const made = plot.current;
    if (!made || at === null) return;
    moving.current = true;
    made.setCursor({ left: made.valToPos(props.data[0][at], 'x'), top: 10 });
    moving.current = false;
  }, [at, props.data]);

  const onKey = (event: JSX.TargetedKeyboardEvent<HTMLDivElement>) => {
    const to = moved(event.key, at ?? -1, count);
    if (to === null || count === 0) return;
    event.preventDefault();
    choose(to);
  };
  const values = at === null ? '' : (props.describe?.(at) ?? valuesAt(props, at));
  return (
    <div class="plot">
      <div
        ref={holder}
        class="canvas"
        role="slider"
        tabIndex={0}
        aria-label={props.label}
        aria-valuemin={0}
        aria-valuemax={count - 1}
        aria-valuenow={at ?? 0}
        aria-valuetext={values || `${count} values; the arrow keys choose one`}
        onKeyDown={onKey}
      />
      <p class="values quiet">{values || ' '}</p>
    </div>
  );
}
