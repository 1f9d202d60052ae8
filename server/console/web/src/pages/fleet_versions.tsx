// The versions of all rigs, or of those of a filter.
import { idOf, pageOf, rigOf } from '../api';
import type { Calibration, ListCalibrationsResponse } from '../contract';
import { RigChoice, kRigFilter, rigColumn } from '../fleet';
import { ListPage } from '../list';
import { Link } from '../parts';
import type { Column } from '../table';
import { kVersionDetails, versionColumn } from './calibrations';

const kColumns: Column<Calibration>[] = [
  versionColumn(undefined),
  rigColumn((version) => rigOf(version.name)),
  ...kVersionDetails,
  {
    head: 'Run',
    cell: ({ provenance }) =>
      provenance && (
        <Link to={pageOf(provenance.recalibration)}>run {idOf(provenance.recalibration)}</Link>
      ),
    value: ({ provenance }) => provenance && Number(idOf(provenance.recalibration)),
  },
];

export function FleetVersions(props: { version: number }) {
  return (
    <ListPage
      title="Calibrations"
      path="calibrations"
      items={(response: ListCalibrationsResponse) => response.calibrations}
      query={[kRigFilter]}
      fixed={{ view: 'BASIC' }}
      version={props.version}
      columns={kColumns}
      next="Older versions"
      empty="No rig matches."
      above={(mistake) => <RigChoice mistake={mistake} />}
    />
  );
}
