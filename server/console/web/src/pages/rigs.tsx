import type { JSX } from 'preact';
import { idOf, pageOf, type RigOverview } from '../api';
import { DataTable, Empty, Link, Loaded, Meter, Pager, Title, When } from '../parts';
import { go, useAddress, useRead, withQuery } from '../state';

const kOrders: [string, string][] = [
  ['', 'name'],
  ['name desc', 'name, from the end'],
  ['last_seen desc', 'seen last'],
  ['last_seen', 'not seen for longest'],
];

function Alarms(props: { of: string[] }) {
  if (props.of.length === 0) return <span class="quiet">none</span>;
  return (
    <ul class="alarms">
      {props.of.map((alarm) => (
        <li key={alarm}>{alarm}</li>
      ))}
    </ul>
  );
}

function row(rig: RigOverview) {
  return [
    <Link to={pageOf(rig.name)}>{idOf(rig.name)}</Link>,
    <When time={rig.lastSeen} />,
    <>
      <Link to={pageOf(rig.name) + '/calibrations/' + rig.activeVersion}>
        {rig.activeVersion === '1' ? '1 (factory)' : rig.activeVersion}
      </Link>
    </>,
    <When time={rig.activeSince} />,
    <Meter
      value={rig.tableEntries}
      of={rig.tableCapacity}
      label={'table fill of ' + idOf(rig.name)}
    />,
    <Alarms of={rig.alarms} />,
  ];
}

export function Rigs(props: { version: number }) {
  const query = useAddress().searchParams;
  const filter = query.get('filter') ?? '';
  const order = query.get('order_by') ?? '';
  const token = query.get('page_token') ?? '';
  const sent = new URLSearchParams({ filter, order_by: order, page_token: token });
  const read = useRead<{ rigs: RigOverview[]; nextPageToken: string }>(
    'rigs?' + sent,
    props.version,
  );
  const search = (event: JSX.TargetedInputEvent<HTMLInputElement>) =>
    go(withQuery({ filter: event.currentTarget.value, page_token: '' }), true);
  return (
    <>
      <Title text="Rigs">Rigs</Title>
      <form class="bar" role="search" onSubmit={(event) => event.preventDefault()}>
        <label>
          Name contains
          <input type="search" value={filter} onInput={search} />
        </label>
        <label>
          Sorted by
          <select
            value={order}
            onChange={(event) =>
              go(withQuery({ order_by: event.currentTarget.value, page_token: '' }))
            }
          >
            {kOrders.map(([value, name]) => (
              <option key={value} value={value}>
                {name}
              </option>
            ))}
          </select>
        </label>
      </form>
      <Loaded read={read}>
        {(listed) =>
          listed.rigs.length === 0 ? (
            <Empty>
              {filter ? (
                <p>
                  No rig has '{filter}' in its name. Take the filter away to see
                  all.
                </p>
              ) : (
                <p>
                  There is no rig yet. Create one: <code>selfcal rig create</code>,
                  then send segments with the client library or{' '}
                  <code>selfcal import</code>.
                </p>
              )}
            </Empty>
          ) : (
            <>
              <DataTable
                caption="Rigs"
                hideCaption
                head={['Rig', 'Last seen', 'Active version', 'Since', 'Tables', 'Alarms']}
                rows={listed.rigs.map(row)}
              />
              <Pager
                next="Next rigs"
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
