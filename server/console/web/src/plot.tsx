// A plot, drawn by uPlot, that adapts to the width and the colours of the page.
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { number } from './format';

export const kColours = ['#2f6fdb', '#d9822b', '#2a9d6f', '#a64ac9'];
const dark = matchMedia('(prefers-color-scheme: dark)');

function ink(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export interface PlotProps {
  label: string; // a description of the plot
  data: uPlot.AlignedData;
  series: uPlot.Series[];
  x?: { label?: string; integers?: boolean; range?: [number, number] };
  y?: string;
  log?: boolean; // logarithmic y axis; needs values above 0
  bands?: uPlot.Band[];
  height?: number;
  cursor?: number; // index of the value under the cursor
  onCursor?: (index: number) => void;
}

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

function axis(label: string | undefined, integers = false, log = false): uPlot.Axis {
  const shown = log ? { filter: powers } : {};
  return {
    label,
    labelSize: label ? 22 : 0,
    stroke: () => ink('--quiet'),
    grid: { stroke: () => ink('--line'), width: 1, ...shown },
    ticks: { stroke: () => ink('--line'), width: 1, ...shown },
    ...(log
      ? {
          ...shown,
          values: (_: uPlot, values: number[]) =>
            values.map((value) => (value === null ? '' : number(value, 1))),
        }
      : {}),
    ...(integers ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000] } : {}),
  };
}

export function Plot(props: PlotProps) {
  const holder = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const onCursor = useRef(props.onCursor);
  onCursor.current = props.onCursor;
  // The cursor is moved by the page or by the pointer.
  const moving = useRef(false);

  useEffect(() => {
    const element = holder.current!;
    const size = () => ({
      width: Math.max(200, element.clientWidth),
      height: props.height ?? 220,
    });
    const made = new uPlot(
      {
        ...size(),
        scales: {
          x: { time: false, range: props.x?.range },
          y: props.log ? { distr: 3 } : {},
        },
        axes: [
          axis(props.x?.label, props.x?.integers),
          { ...axis(props.y, false, props.log), size: 64 },
        ],
        series: [{}, ...props.series],
        bands: props.bands,
        legend: { show: props.series.length > 1, live: false },
        cursor: { drag: { x: false, y: false } },
        hooks: {
          setCursor: [
            (u) => {
              // uPlot also calls this when the size of the plot changes.
              const pointed = !moving.current && u.over.matches(':hover');
              if (pointed && u.cursor.idx != null) {
                onCursor.current?.(u.cursor.idx);
              }
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
    if (!made || props.cursor === undefined) return;
    moving.current = true;
    made.setCursor({
      left: made.valToPos(props.data[0][props.cursor], 'x'),
      top: 10,
    });
    moving.current = false;
  }, [props.cursor, props.data]);

  return <div ref={holder} class="plot" role="img" aria-label={props.label} />;
}
