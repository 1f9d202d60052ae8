// The convergence of a run over its iterations: the cost, and each parameter with
// its sigma, relative to its start value.
import { useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import type { ComponentProgress } from './contract';
import { component, estimateText, heading, number, shownUnit, valueText } from './format';
import { Choice } from './parts';
import { kColours, Plot } from './plot';
import { DataTable, type Column } from './table';

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

// The last step, in sigmas.
function lastStep(course: ComponentProgress[]): number | undefined {
  if (course.length < 2) return undefined;
  const [before, now] = course.slice(-2);
  return Math.abs(now.moved - before.moved) / now.sigma;
}

function stepText(sigmas: number | undefined): string {
  if (sigmas === undefined) return '';
  return sigmas < kStill ? `less than ${kStill}` : number(sigmas, 2);
}

interface ParameterCourse {
  name: string; // of the component
  course: ComponentProgress[];
  now: ComponentProgress;
  // The unit in which the parameter is shown, and the factor to it.
  unit: string;
  factor: number;
}

function coursesOf(steps: Step[]): ParameterCourse[] {
  const courses = new Map<string, ComponentProgress[]>();
  for (const { parameters } of steps) {
    for (const parameter of parameters) {
      const course = courses.get(parameter.component);
      if (course) course.push(parameter);
      else courses.set(parameter.component, [parameter]);
    }
  }
  return [...courses].map(([name, course]) => {
    const now = course[course.length - 1];
    return { name, course, now, ...shownUnit(now.unit) };
  });
}

function changeText(of: ParameterCourse): string {
  return estimateText(of.factor * of.now.moved, of.factor * of.now.sigma, of.unit);
}

const kColumns: Column<ParameterCourse>[] = [
  {
    head: 'Parameter',
    cell: (of) => component(of.name),
    value: (of) => component(of.name),
  },
  {
    head: 'Value',
    cell: ({ now, factor, unit }) =>
      valueText(factor * now.value, factor * now.sigma) + (unit === '-' ? '' : ' ' + unit),
  },
  { head: 'Change since the start', cell: changeText },
  {
    head: 'Last step [standard deviations]',
    cell: ({ course }) => stepText(lastStep(course)),
    value: ({ course }) => lastStep(course),
  },
  {
    head: 'Over the iterations',
    cell: (of) => (
      <Course of={of.course} label={`${component(of.name)} has changed by ${changeText(of)}`} />
    ),
  },
];

// One parameter over the iterations, with axes.
function ParameterPlot(props: { steps: Step[]; of: ParameterCourse }) {
  const { steps } = props;
  const { name, factor, unit } = props.of;
  const data = useMemo(() => {
    const at = steps.map((step) => step.parameters.find((p) => p.component === name));
    const values = (value: (p: ComponentProgress) => number) =>
      at.map((p) => (p ? factor * value(p) : null));
    return [
      steps.map((step) => step.iteration),
      values((p) => p.moved),
      values((p) => p.moved + p.sigma),
      values((p) => p.moved - p.sigma),
    ] as uPlot.AlignedData;
  }, [steps, name, factor]);
  const bound = { stroke: kColours[0] + '66', width: 1, points: { show: false } };
  return (
    <Plot
      label={`Change of the ${component(name)} by iteration, with a band of one standard deviation`}
      data={data}
      x={{ label: 'iteration', integers: true }}
      y={heading('change', unit)}
      series={[
        { label: component(name), stroke: kColours[0], width: 2 },
        { label: 'plus one standard deviation', ...bound },
        { label: 'minus one standard deviation', ...bound },
      ]}
      bands={[{ series: [2, 3], fill: kColours[0] + '22' }]}
    />
  );
}

function Parameters(props: { steps: Step[] }) {
  const courses = useMemo(() => coursesOf(props.steps), [props.steps]);
  const [name, setName] = useState(courses[0].name);
  const chosen = courses.find((one) => one.name === name) ?? courses[0];
  return (
    <>
      <h2>Parameters</h2>
      <p class="quiet">
        Each relative to its start value (dashed), with a band of one standard deviation at that
        iteration.
      </p>
      <div class="bar">
        <Choice
          label="Parameter"
          value={chosen.name}
          of={courses.map((one) => [one.name, component(one.name)])}
          onChoice={setName}
        />
      </div>
      <ParameterPlot steps={props.steps} of={chosen} />
      <DataTable caption="Parameters by iteration" columns={kColumns} items={courses} />
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
          label="Largest step of a parameter by iteration, in standard deviations"
          data={step}
          x={x}
          y="step [standard deviations]"
          series={[{ label: 'step', stroke: kColours[1], width: 2 }]}
        />
      </div>
      {steps.some((s) => s.parameters.length > 0) && <Parameters steps={steps} />}
    </>
  );
}
