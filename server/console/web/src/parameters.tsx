// The certainty of parameters, relative to the factory calibration.
import type { Calibration, ComponentEstimate, Rig } from './contract';
import { component, estimateText, heading, matches, shown, shownUnit, sigmaText } from './format';
import { kWeak, kWell, Remaining } from './parts';
import { DataTable, type Column } from './table';

export interface Known extends ComponentEstimate {
  tolerance: number;
  ratio: number; // sigma as a fraction of the factory tolerance
}

export function knownOf(active: Calibration, factory: Calibration): Known[] {
  const tolerances = new Map(factory.estimates.map((e) => [e.component, e.sigma]));
  return active.estimates
    .map((estimate) => {
      const tolerance = tolerances.get(estimate.component) ?? 0;
      return { ...estimate, tolerance, ratio: estimate.sigma / tolerance };
    })
    .filter((estimate) => estimate.tolerance > 0);
}

// The parameters about which little more is known than from the factory, the
// least certain first.
export function weakOf(known: Known[]): Known[] {
  return known.filter((e) => e.ratio > kWeak).sort((a, b) => b.ratio - a.ratio);
}

function certainty(ratio: number): string {
  if (ratio <= kWell) return 'well known';
  return ratio <= kWeak
    ? 'better known than from the factory'
    : 'little more is known than from the factory';
}

const kColumns: Column<Known>[] = [
  {
    head: 'Parameter',
    cell: (e) => heading(component(e.component), shown(e).unit),
    value: (e) => component(e.component),
  },
  {
    head: 'Value ± standard deviation',
    cell: (e) => estimateText(shown(e).value, shown(e).sigma, '-'),
  },
  { head: 'Factory tolerance', cell: (e) => sigmaText(shownUnit(e.unit).factor * e.tolerance) },
  {
    head: 'Remaining uncertainty',
    cell: (e) => <Remaining ratio={e.ratio} of={component(e.component)} />,
    value: (e) => e.ratio,
  },
];

function Group(props: { name: string; of: Known[] }) {
  const mean = Math.exp(props.of.reduce((sum, e) => sum + Math.log(e.ratio), 0) / props.of.length);
  return (
    <section>
      <h3>
        {props.name}: {certainty(mean)}
      </h3>
      <DataTable
        caption={'Uncertainty of the group ' + props.name}
        columns={kColumns}
        items={props.of}
      />
    </section>
  );
}

export function Certainty(props: { rig: Rig; of: Known[] }) {
  const groups = props.rig.groups.map(({ group, patterns }) => ({
    group,
    members: props.of.filter((e) => patterns.some((pattern) => matches(pattern, e.component))),
  }));
  return (
    <>
      <h2>Uncertainty by group</h2>
      <p class="quiet">
        The remaining uncertainty is the standard deviation relative to the factory tolerance.
      </p>
      <div class="side tables">
        {groups
          .filter(({ members }) => members.length > 0)
          .map(({ group, members }) => (
            <Group key={group} name={group} of={members} />
          ))}
      </div>
    </>
  );
}
