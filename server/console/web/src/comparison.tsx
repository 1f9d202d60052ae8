// The comparison of two versions of a calibration.
import { useMemo } from 'preact/hooks';
import { rigPath } from './api';
import type {
  Calibration,
  CompareCalibrationsResponse,
  CompareCalibrationsResponse_Difference as Difference,
} from './contract';
import { clock, component, heading, number, shown, sigmaText, valueText, words } from './format';
import { Choice, Loaded } from './parts';
import { go, useAddress, useRead, withQuery } from './state';
import { DataTable, type Column } from './table';

// Differences above are not explained by chance.
const kSignificant = 3;
// A difference in standard deviations has two decimals.
const kSigmaDigit = 0.1;

// Both values and their difference in the unit in which they are shown.
export function shownDifference(d: Difference) {
  const rotation = d.fromFactoryA !== undefined && d.fromFactoryB !== undefined;
  const side = (value: number, fromFactory?: number) =>
    shown({ ...d, value, fromFactory: rotation ? fromFactory : undefined });
  const a = side(d.valueA, d.fromFactoryA);
  const b = side(d.valueB, d.fromFactoryB);
  const { value, sigma, unit } = side(d.difference);
  return { a: a.value, b: b.value, difference: value, sigma, unit, valueUnit: a.unit };
}

function sigmasOf(d: Difference): number {
  return d.sigma > 0 ? d.difference / d.sigma : 0;
}

// The largest differences, relative to their standard deviation.
export function largestOf(compared: CompareCalibrationsResponse, count: number): Difference[] {
  return compared.differences
    .filter((d) => d.sigma > 0)
    .sort((x, y) => Math.abs(sigmasOf(y)) - Math.abs(sigmasOf(x)))
    .slice(0, count);
}

// Whether the versions agree, in a sentence.
export function agreement(compared: CompareCalibrationsResponse): string {
  if (compared.degrees === 0) {
    return 'Neither version determines a direction clearly better than the factory: nothing can be compared.';
  }
  const more = compared.significant ? 'more' : 'no more';
  return `Together the parameters differ by ${more} than their uncertainty explains (probability ${number(compared.probability, 2)}).`;
}

// ------------------------------------------------------------- the chart

const kWidth = 180;
const kHeight = 20;
const kEdge = 12; // for the labels of the outer ticks
const kLeastRange = 4; // sigmas

// A tick at each of these, of which the chart has at most seven.
function ticksOf(range: number): number[] {
  const step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((s) => range / s <= 3) ?? range / 3;
  const most = Math.floor(range / step);
  return Array.from({ length: 2 * most + 1 }, (_, i) => (i - most) * step);
}

const place = (sigmas: number, range: number) =>
  kWidth / 2 + (kWidth / 2 - kEdge) * (sigmas / range);

function Ticks(props: { range: number }) {
  return (
    <svg class="interval ticks" viewBox={`0 0 ${kWidth} ${kHeight}`} aria-hidden="true">
      {ticksOf(props.range).map((tick) => (
        <text key={tick} x={place(tick, props.range)} y={kHeight - 5} text-anchor="middle">
          {tick}
        </text>
      ))}
    </svg>
  );
}

// A difference with an interval of two standard deviations.
function Interval(props: { of: Difference; range: number }) {
  const { range } = props;
  const sigmas = sigmasOf(props.of);
  const clamped = (x: number) => place(Math.min(range, Math.max(-range, x)), range);
  const middle = kHeight / 2;
  return (
    <svg
      class={Math.abs(sigmas) > kSignificant ? 'interval significant' : 'interval'}
      viewBox={`0 0 ${kWidth} ${kHeight}`}
      role="img"
      aria-label={`${component(props.of.component)}: ${valueText(sigmas, kSigmaDigit)} standard deviations`}
    >
      {ticksOf(range).map((tick) => (
        <line
          key={tick}
          x1={place(tick, range)}
          x2={place(tick, range)}
          y1={0}
          y2={kHeight}
          class={tick === 0 ? 'zero' : 'tick'}
        />
      ))}
      <line
        x1={clamped(sigmas - 2)}
        x2={clamped(sigmas + 2)}
        y1={middle}
        y2={middle}
        class="span"
      />
      <circle cx={clamped(sigmas)} cy={middle} r={4} class="estimate" />
    </svg>
  );
}

function columnsOf(compared: CompareCalibrationsResponse): Column<Difference>[] {
  const range = Math.max(
    kLeastRange,
    ...compared.differences.map((d) => Math.abs(sigmasOf(d)) + 2),
  );
  return [
    {
      head: 'Parameter',
      cell: (d) => heading(component(d.component), shownDifference(d).valueUnit),
      value: (d) => component(d.component),
    },
    {
      head: `Version ${compared.versionA}`,
      cell: (d) => valueText(shownDifference(d).a, shownDifference(d).sigma),
    },
    {
      head: `Version ${compared.versionB}`,
      cell: (d) => valueText(shownDifference(d).b, shownDifference(d).sigma),
    },
    {
      head: 'Difference',
      cell: (d) => {
        const { difference, sigma } = shownDifference(d);
        return `${valueText(difference, sigma)} ± ${sigmaText(sigma)}`;
      },
    },
    {
      head: 'In standard deviations',
      cell: (d) => (
        <span class={Math.abs(sigmasOf(d)) > kSignificant ? 'strong' : ''}>
          {valueText(sigmasOf(d), kSigmaDigit)}
        </span>
      ),
      value: (d) => Math.abs(sigmasOf(d)),
    },
    {
      head: 'Interval of ± 2 standard deviations',
      below: <Ticks range={range} />,
      cell: (d) => <Interval of={d} range={range} />,
    },
  ];
}

function Differences(props: { of: CompareCalibrationsResponse }) {
  const { of } = props;
  const columns = useMemo(() => columnsOf(of), [of]);
  return (
    <>
      <p>
        {agreement(of)}
        {of.degrees > 0 &&
          ` Chi-square ${number(of.chiSquare)} with ${of.degrees} degrees of freedom.`}
        {of.sharedSegments > 0 &&
          ` The versions share ${of.sharedSegments} segments, of which ${of.sharedSegmentsUsed} are accounted for.`}
      </p>
      <DataTable
        caption={`Version ${of.versionB} minus version ${of.versionA}`}
        columns={columns}
        items={of.differences}
      />
    </>
  );
}

export function Comparison(props: { rig: string; of: Calibration[] }) {
  const query = useAddress().searchParams;
  const newest = props.of[0].version;
  const a = query.get('a') ?? props.of[1]?.version ?? newest;
  const b = query.get('b') ?? newest;
  const other = new URLSearchParams({ b: `rigs/${props.rig}/calibrations/${b}` });
  const read = useRead<CompareCalibrationsResponse>(
    `${rigPath(props.rig)}/calibrations/${encodeURIComponent(a)}:compare?${other}`,
  );
  const versions = props.of.map((c): [string, string] => [
    c.version,
    c.version === '1' ? '1, factory' : `${c.version}, ${words(c.state)}, ${clock(c.createTime)}`,
  ]);
  const choose = (values: { a: string; b: string }) => go(withQuery(values), true);
  return (
    <section id="comparison">
      <h2>Comparison of two versions</h2>
      <div class="bar">
        <Choice
          label="From version"
          value={a}
          of={versions}
          onChoice={(to) => choose({ a: to, b })}
        />
        <Choice
          label="to version"
          value={b}
          of={versions}
          onChoice={(to) => choose({ a, b: to })}
        />
        <button type="button" onClick={() => choose({ a: b, b: a })}>
          Exchange
        </button>
      </div>
      <Loaded read={read}>{(compared) => <Differences of={compared} />}</Loaded>
    </section>
  );
}
