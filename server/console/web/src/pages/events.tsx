import { idOf, pageOf, rigPath } from '../api';
import type { Event, ListEventsResponse } from '../contract';
import { clock, words } from '../format';
import { ListPage, type Column } from '../list';
import { Link } from '../parts';

const kColumns: Column<Event>[] = [
  { head: 'Number', cell: (event) => event.number },
  {
    head: 'Time',
    cell: (event) => <time dateTime={event.time}>{clock(event.time)}</time>,
  },
  { head: 'Rig', cell: (event) => <Link to={pageOf(event.rig)}>{idOf(event.rig)}</Link> },
  { head: 'What', cell: (event) => words(event.kind) },
  { head: 'Detail', cell: (event) => event.detail },
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
