import { rigPath, type Segment } from '../api';
import { bytes, number } from '../format';
import { ListPage, type Column } from '../list';
import { Badge, SegmentLink, When } from '../parts';

function kept(segment: Segment): string {
  const tables = segment.scores.filter((s) => s.inTable).map((s) => s.group);
  return tables.length > 0 ? tables.join(', ') : 'none';
}

const kColumns: Column<Segment>[] = [
  { head: 'Segment', cell: (segment) => <SegmentLink name={segment.name} /> },
  { head: 'Received', cell: (segment) => <When time={segment.receiveTime} /> },
  { head: 'State', cell: (segment) => <Badge state={segment.state} /> },
  { head: 'In tables', cell: kept },
  {
    head: 'Gain [nats]',
    cell: (segment) =>
      segment.scores.map((s) => `${s.group} ${number(s.gainNats)}`).join(', '),
  },
  {
    head: 'Reprojection rms [px]',
    cell: (segment) =>
      segment.residuals ? number(segment.residuals.reprojectionRmsPx) : '',
  },
  {
    head: 'Data',
    cell: (segment) => (segment.hasData ? bytes(segment.payloadBytes) : 'dropped'),
  },
];

export function Segments(props: { rig: string; version: number }) {
  return (
    <ListPage
      title={'Segments of ' + props.rig}
      path={rigPath(props.rig) + '/segments'}
      items="segments"
      version={props.version}
      columns={kColumns}
      next="Older segments"
      empty={
        <>
          No segment has arrived yet. Send some with the client library, or{' '}
          <code>selfcal import {props.rig} DIR</code>.
        </>
      }
    />
  );
}
