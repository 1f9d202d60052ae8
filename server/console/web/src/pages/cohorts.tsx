import type { CohortVersion, ListCohortsResponse } from '../contract';
import { ListPage } from '../list';
import { Link, When } from '../parts';
import type { Column } from '../table';

const nameOf = (cohort: CohortVersion) => `${cohort.label}=${cohort.value}`;

// The page of the parameters of the rigs of the cohort.
function parametersOf(cohort: CohortVersion): string {
  const filter = `labels.${cohort.label} = "${cohort.value.replace(/["\\]/g, '\\$&')}"`;
  return '/parameters?' + new URLSearchParams({ filter }).toString();
}

const kColumns: Column<CohortVersion>[] = [
  {
    head: 'Cohort',
    cell: (cohort) => <Link to={parametersOf(cohort)}>{nameOf(cohort)}</Link>,
    value: nameOf,
  },
  { head: 'Version', cell: (cohort) => cohort.version, value: (cohort) => Number(cohort.version) },
  {
    head: 'Computed',
    cell: (cohort) => <When time={cohort.createTime} />,
    value: (cohort) => Date.parse(cohort.createTime ?? ''),
  },
  {
    head: 'Rigs',
    cell: (cohort) => cohort.cohort?.rigs,
    value: (cohort) => cohort.cohort?.rigs,
  },
  {
    head: 'Calibrated',
    cell: (cohort) => cohort.cohort?.calibrated,
    value: (cohort) => cohort.cohort?.calibrated,
  },
  {
    head: 'Outliers',
    cell: (cohort) => (
      <ul class="alarms">
        {cohort.cohort?.outliers.map(({ rig }) => (
          <li key={rig}>
            <Link to={'/' + rig}>{rig.slice('rigs/'.length)}</Link>
          </li>
        ))}
      </ul>
    ),
    value: (cohort) => cohort.cohort?.outliers.length,
    wide: true,
  },
];

export function Cohorts(props: { version: number }) {
  return (
    <ListPage
      title="Cohorts"
      path="cohorts"
      items={(response: ListCohortsResponse) => response.cohorts}
      version={props.version}
      columns={kColumns}
      next="Next cohorts"
      empty={
        <>
          No cohort was described. A hub describes those of a label that its setting{' '}
          <code>cohort-label</code> names, such as <code>model</code>.
        </>
      }
    />
  );
}
