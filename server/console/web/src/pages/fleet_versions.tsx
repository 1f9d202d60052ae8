// The versions of all rigs, or of those of a filter.
import { idOf, pageOf, rigOf } from '../api';
import {
  Calibration_State,
  Verdict_Kind,
  type Calibration,
  type ListCalibrationsResponse,
} from '../contract';
import { kRigFilter, rigColumn } from '../fleet';
import { number } from '../format';
import { ListPage } from '../list';
import {
  ListFilter,
  NoMatch,
  isNarrowed,
  valuesOf,
  type FilterSyntax,
  type Menu,
} from '../list_filter';
import { Link } from '../parts';
import { useAddress } from '../state';
import type { Column } from '../table';
import { kVersionDetails, versionColumn } from './calibrations';

const kColumns: Column<Calibration>[] = [
  versionColumn(undefined),
  rigColumn((version) => rigOf(version.name)),
  ...kVersionDetails,
  {
    head: 'Temperature [°C]',
    cell: ({ provenance }) => provenance?.temperature && number(provenance.temperature.meanC),
    order: 'temperature_c',
    partial: true,
  },
  {
    head: 'Run',
    cell: ({ provenance }) =>
      provenance && (
        <Link to={pageOf(provenance.recalibration)}>run {idOf(provenance.recalibration)}</Link>
      ),
    value: ({ provenance }) => provenance && Number(idOf(provenance.recalibration)),
  },
];

const kMenus: Menu[] = [
  { name: 'state', label: 'State', of: valuesOf(Calibration_State) },
  { name: 'verdict', label: 'Verdict', of: valuesOf(Verdict_Kind) },
];

const kSyntax: FilterSyntax = {
  items: 'versions',
  equal: [
    ['state', kMenus[0].of.join(', ')],
    ['verdict', kMenus[1].of.join(', ')],
  ],
  compared: [['create_time'], ['temperature_c', '°C']],
  note: 'The temperature is the mean over the segments that the version was computed from.',
  examples: [
    'verdict = NOT_TRUSTWORTHY',
    'state = ACTIVE AND temperature_c >= 40',
    'create_time >= 2026-11-21T04:00:00Z',
  ],
};

function Nothing() {
  if (isNarrowed(useAddress().searchParams, kMenus)) {
    return <NoMatch item="version" menus={kMenus} />;
  }
  return <p>No rig matches.</p>;
}

export function FleetVersions(props: { version: number }) {
  return (
    <ListPage
      title="Calibrations"
      path="calibrations"
      items={(response: ListCalibrationsResponse) => response.calibrations}
      query={[kRigFilter]}
      menus={kMenus}
      fixed={{ view: 'BASIC' }}
      order={['create_time', 'desc']}
      version={props.version}
      columns={kColumns}
      next="Older versions"
      empty={<Nothing />}
      above={(mistake) => (
        <ListFilter mistake={mistake} acrossRigs syntax={kSyntax} menus={kMenus} />
      )}
    />
  );
}
