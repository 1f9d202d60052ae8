// The convergence of a run over its iterations: the cost, and each parameter with
// its sigma, relative to its start value.
import { useMemo } from 'preact/hooks';
import type uPlot from 'uplot';
import type { ComponentProgress } from './contract';
import { component, number, quantity } from './format';
import { DataTable } from './parts';
import { kColours, Plot } from './plot';

export interface Step {
  iteration: number;
  cost: number;
  step: number; // largest step of a parameter, in sigmas
  parameters: ComponentProgress[];
}

const kWidth = 200;
const kHeight = 34;
const kEdge = 3;
// A smaller step, in sigmas, changes no significant digit of a parameter.
const kStill = 0.01;

// The course of one parameter, with a band of one sigma and a line at its start
// value.
function Course(props: { of: ComponentProgress[]; label: string }) {
  const ends = props.of.flatMap((p) => [p.moved - p.sigma, p.moved + p.sigma, 0]);
  const [least, most] = [Math.min(...ends), Math.max(...ends)];
  const x = (i: number) => kEdge + (i * (kWidth - 2 * kEdge)) / Math.max(1, props.of.length - 1);
  const y = (value: number) =>
    kHeight - kEdge - ((value - least) * (kHeight - 2 * kEdge)) / (most - least || 1);
  const line = (value: (p: ComponentProgress) => number) =>
    props.of.map((p, i) => `${x(i)},${y(value(p))}`);
  const above = line((p) => p.moved + p.sigma);
  const below = line((p) => p.moved - p.sigma).reverse();
  const last = props.of.length - 1;
  return (
    <svg class="course" viewBox={`0 0 ${kWidth} ${kHeight}`} role="img" aria-label={props.label}>
      <polygon points={[...above, ...below].join(' ')} class="spread" />
      <line x1={0} x2={kWidth} y1={y(0)} y2={y(0)} class="start" />
      <polyline points={line((p) => p.moved).join(' ')} class="path" />
      <circle cx={x(last)} cy={y(props.of[last].moved)} r={2.5} class="keyframe" />
    </svg>
  );
}

function stillMoves(course: ComponentProgress[]): string {
  if (course.length < 2) return '';
  const [before, now] = course.slice(-2);
  const sigmas = Math.abs(now.moved - before.moved) / now.sigma;
  return sigmas < kStill ? `less than ${kStill}` : number(sigmas, 2);
}

function Parameters(props: { steps: Step[] }) {
  const courses = new Map<string, ComponentProgress[]>();
  for (const { parameters } of props.steps) {
    for (const parameter of parameters) {
      courses.set(parameter.component, [...(courses.get(parameter.component) ?? []), parameter]);
    }
  }
  const rows = [...courses].map(([name, course]) => {
    const now = course[course.length - 1];
    const moved = quantity(now.moved, now.unit, 3);
    const sigma = quantity(now.sigma, now.unit, 3);
    return [
      component(name),
      quantity(now.value, now.unit),
      moved,
      sigma,
      stillMoves(course),
      <Course of={course} label={`${component(name)} has moved by ${moved}, sigma ${sigma}`} />,
    ];
  });
  return (
    <>
      <h2>Parameters</h2>
      <p class="quiet">
        Each relative to its start value (dashed), with a band of one sigma at that iteration.
      </p>
      <DataTable
        caption="Parameters by iteration"
        head={[
          'Parameter',
          'Now',
          'Moved by',
          'Sigma',
          'Last step [sigmas]',
          'Over the iterations',
        ]}
        rows={rows}
      />
    </>
  );
}

export function Convergence(props: { steps: Step[] }) {
  const { steps } = props;
  const [cost, step] = useMemo(() => {
    const x = steps.map((s) => s.iteration);
    return [
      [x, steps.map((s) => s.cost)] as uPlot.AlignedData,
      [x, steps.map((s) => s.step)] as uPlot.AlignedData,
    ];
  }, [steps]);
  const x = { label: 'iteration', integers: true };
  return (
    <>
      <div class="side">
        <Plot
          label="Cost by iteration"
          data={cost}
          x={x}
          y="cost"
          log={steps.every((s) => s.cost > 0)}
          series={[{ label: 'cost', stroke: kColours[0], width: 2 }]}
        />
        <Plot
          label="Largest step of a parameter by iteration"
          data={step}
          x={x}
          y="step [sigmas]"
          series={[{ label: 'step', stroke: kColours[1], width: 2 }]}
        />
      </div>
      {steps.some((s) => s.parameters.length > 0) && <Parameters steps={steps} />}
    </>
  );
}
