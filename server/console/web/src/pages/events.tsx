import { rigPath } from '../api';
import type { Event, ListEventsResponse } from '../contract';
import { rigColumn } from '../fleet';
import { clock, words } from '../format';
import { ListPage } from '../list';
import type { Column } from '../table';

const kColumns: Column<Event>[] = [
  { head: 'Number', cell: (event) => event.number, value: (event) => Number(event.number) },
  {
    head: 'Time',
    cell: (event) => <time dateTime={event.time}>{clock(event.time)}</time>,
    value: (event) => Date.parse(event.time ?? ''),
  },
  rigColumn((event) => event.rig),
  { head: 'Event', cell: (event) => words(event.kind), value: (event) => words(event.kind) },
  { head: 'Detail', cell: (event) => event.detail, value: (event) => event.detail, wide: true },
];

// The events of one rig, or of all rigs if `rig` is ''.
export function Events(props: { rig: string; version: number }) {
  return (
    <ListPage
      title={props.rig ? 'Events of ' + props.rig : 'Events'}
      path={props.rig ? rigPath(props.rig) + '/events' : 'events'}
      items={(response: ListEventsResponse) => response.events}
      order={['number', 'desc']}
      version={props.version}
      columns={kColumns}
      next="Older events"
      empty="There are no events yet. New rigs, runs and new versions are listed here."
    />
  );
}
