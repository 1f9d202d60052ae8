import { idOf, pageOf, type Event } from '../api';
import { clock, words } from '../format';
import { DataTable, Empty, Link, Loaded, Pager, Title } from '../parts';
import { useAddress, useRead, withQuery } from '../state';

export function Events(props: { rig: string; version: number }) {
  const token = useAddress().searchParams.get('page_token') ?? '';
  const base = props.rig ? `rigs/${encodeURIComponent(props.rig)}/` : '';
  const read = useRead<{ events: Event[]; nextPageToken: string }>(
    `${base}events?page_token=${token}`,
    props.version,
  );
  const title = props.rig ? 'Events of ' + props.rig : 'Events';
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {(listed) =>
          listed.events.length === 0 ? (
            <Empty>
              Nothing has happened yet. Rigs that are created, runs and new
              versions are listed here.
            </Empty>
          ) : (
            <>
              <DataTable
                caption={title}
                hideCaption
                head={['Number', 'Time', 'Rig', 'What', 'Detail']}
                rows={listed.events.map((event) => [
                  event.number,
                  <time dateTime={event.time}>{clock(event.time)}</time>,
                  <Link to={pageOf(event.rig)}>{idOf(event.rig)}</Link>,
                  words(event.kind),
                  event.detail,
                ])}
              />
              <Pager
                next="Older events"
                first={token ? withQuery({ page_token: '' }) : null}
                more={
                  listed.nextPageToken
                    ? withQuery({ page_token: listed.nextPageToken })
                    : null
                }
              />
            </>
          )
        }
      </Loaded>
    </>
  );
}
