// One parameter of the active versions of many rigs.
import type { JSX } from 'preact';
import { useMemo } from 'preact/hooks';
import { pageOf } from '../api';
import type { Estimate, ListEstimatesResponse } from '../contract';
import { RigFilter, rigColumn } from '../fleet';
import { component, heading, shownUnit, sigmaText, valueText } from '../format';
import { Histogram } from '../histogram';
import { ListPage } from '../list';
import { Link, Problem } from '../parts';
import { go, useAddress, useRead, withQuery } from '../state';
import type { Column } from '../table';

const kDefault = 'cam0.focal.x';
// Rigs whose parameter is shown in the picture.
const kMost = '1000';

const factorOf = (estimate: Estimate) => shownUnit(estimate.unit).factor;

function differenceText(estimate: Estimate): string {
  if (estimate.fromFactory === undefined) return '';
  const factor = factorOf(estimate);
  return valueText(factor * estimate.fromFactory, factor * (estimate.sigma ?? 0));
}

const kColumns: Column<Estimate>[] = [
  rigColumn((estimate) => estimate.rig),
  {
    head: 'Version',
    cell: (estimate) => (
      <Link to={pageOf(estimate.rig) + '/calibrations/' + estimate.version}>
        {estimate.version}
      </Link>
    ),
    value: (estimate) => Number(estimate.version),
  },
  {
    head: 'Value',
    cell: (estimate) =>
      valueText(factorOf(estimate) * estimate.value, factorOf(estimate) * (estimate.sigma ?? 0)),
    value: (estimate) => estimate.value,
  },
  {
    head: 'Standard deviation',
    cell: (estimate) =>
      estimate.sigma === undefined ? '' : sigmaText(factorOf(estimate) * estimate.sigma),
    value: (estimate) => estimate.sigma,
  },
  {
    head: 'From the factory value',
    cell: differenceText,
    value: (estimate) => estimate.fromFactory,
  },
];

function Distribution(props: { name: string; filter: string; version: number }) {
  const query = new URLSearchParams({
    component: props.name,
    only_active: 'true',
    page_size: kMost,
  });
  if (props.filter) query.set('filter', props.filter);
  const read = useRead<ListEstimatesResponse>('estimates?' + query.toString(), props.version);
  const { unit, of } = useMemo(() => {
    const known = (read.value?.estimates ?? []).filter((e) => e.fromFactory !== undefined);
    const { unit, factor } = shownUnit(known[0]?.unit ?? '');
    return { unit, of: [{ label: 'rigs', values: known.map((e) => factor * e.fromFactory!) }] };
  }, [read.value]);
  if (of[0].values.length < 2) return null;
  return (
    <Histogram
      label={`Histogram of the ${component(props.name)} over the rigs`}
      x={heading('difference from the factory value', unit)}
      y="number of rigs"
      of={of}
    />
  );
}

export function FleetParameters(props: { version: number }) {
  const query = useAddress().searchParams;
  const name = query.get('component') || kDefault;
  const filter = query.get('filter') ?? '';
  const choose = (event: JSX.TargetedEvent<HTMLInputElement>) =>
    go(withQuery({ component: event.currentTarget.value, page_token: '' }), true);
  return (
    <ListPage
      title="Parameters"
      path="estimates"
      items={(response: ListEstimatesResponse) => response.estimates}
      query={['filter']}
      fixed={{ component: name, only_active: 'true' }}
      version={props.version}
      columns={kColumns}
      next="Next rigs"
      empty={`No active version of these rigs has the parameter ${name}.`}
      above={(mistake) => (
        <>
          <form class="bar" role="search" onSubmit={(event) => event.preventDefault()}>
            <label>
              Parameter
              <input type="search" value={name} size={24} onChange={choose} />
            </label>
            <RigFilter label="Rigs" parameter="filter" />
          </form>
          {mistake ? (
            <Problem error={mistake} />
          ) : (
            <Distribution name={name} filter={filter} version={props.version} />
          )}
        </>
      )}
    />
  );
}
