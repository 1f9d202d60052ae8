import { useState } from 'preact/hooks';
import { mayAdminister } from '../action';
import { idOf, pageOf } from '../api';
import { kRecalibrate, type BulkAction } from '../bulk';
import { BulkDialog } from '../bulk_dialog';
import { kConfigure, kLabel, kRollBack, type BulkForm } from '../bulk_forms';
import type { Caller, ListActivityResponse, ReportState, RigActivity } from '../contract';
import { RigFilter } from '../fleet';
import { Labels } from '../labels';
import { ListPage } from '../list';
import { Link, Meter, NameLink, Problem, When } from '../parts';
import { go, useAddress, withQuery } from '../state';
import type { Column } from '../table';

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

// The last report between a device and its hub, and the records that wait.
function Reports(props: { of: ReportState | undefined }) {
  if (!props.of) return <span class="quiet">none</span>;
  const { time, waiting } = props.of;
  return (
    <>
      <When time={time} />
      {waiting !== '0' && `, ${waiting} wait`}
    </>
  );
}

const kColumns: Column<RigActivity>[] = [
  {
    head: 'Rig',
    cell: (rig) => <NameLink name={rig.name}>{idOf(rig.name)}</NameLink>,
    order: 'name',
  },
  { head: 'Last seen', cell: (rig) => <When time={rig.lastSeen} />, order: 'last_seen' },
  {
    head: 'Active version',
    cell: (rig) => (
      <Link to={pageOf(rig.name) + '/calibrations/' + rig.activeVersion}>
        {rig.activeVersion === '1' ? '1 (factory)' : rig.activeVersion}
      </Link>
    ),
    value: (rig) => Number(rig.activeVersion),
  },
  {
    head: 'Active since',
    cell: (rig) => <When time={rig.activeSince} />,
    value: (rig) => Date.parse(rig.activeSince ?? ''),
  },
  {
    head: 'Segments in tables',
    cell: (rig) => (
      <Meter
        value={rig.tableEntries}
        of={rig.tableCapacity}
        label={'table fill of ' + idOf(rig.name)}
      />
    ),
    value: (rig) => rig.tableEntries / rig.tableCapacity,
  },
  {
    head: 'Reports',
    cell: (rig) => <Reports of={rig.uplink ?? rig.device} />,
    value: (rig) => Date.parse((rig.uplink ?? rig.device)?.time ?? ''),
  },
  { head: 'Labels', cell: (rig) => <Labels of={rig.labels} />, wide: true },
  {
    head: 'Alarms',
    cell: (rig) => <Alarms of={rig.alarms} />,
    order: 'alarms',
    wide: true,
  },
];

function Nothing(props: { filter: string; withAlarms: boolean }) {
  if (props.withAlarms) return <p>No rig has alarms.</p>;
  return props.filter ? (
    <p>No rig matches '{props.filter}'. Clear the filter to see all.</p>
  ) : (
    <p>
      There is no rig yet. Create one with <code>selfcal rig create</code>, then send segments with
      the client library or <code>selfcal segment import</code>.
    </p>
  );
}

// The changes that an administrator may make: actions, or forms that make one.
const kOffers: (BulkAction | BulkForm)[] = [kRecalibrate, kRollBack, kLabel, kConfigure];

interface Asked {
  offer: BulkAction | BulkForm;
  query: Record<string, string>; // of the list of rigs
}

function AskedDialog(props: {
  of: Asked;
  onAction: (action: BulkAction) => void;
  onEnd: () => void;
}) {
  const { offer, query } = props.of;
  if ('Form' in offer) return <offer.Form onAction={props.onAction} onEnd={props.onEnd} />;
  return <BulkDialog action={offer} query={query} onEnd={props.onEnd} />;
}

// The changes of all rigs that the filter finds, for an administrator.
function Administration(props: { filter: string; withAlarms: boolean }) {
  const [asked, setAsked] = useState<Asked | null>(null);
  const query = { filter: props.filter, with_alarms: String(props.withAlarms) };
  return (
    <p class="buttons">
      {kOffers.map((offer) => (
        <button key={offer.imperative} type="button" onClick={() => setAsked({ offer, query })}>
          {offer.imperative} these rigs
        </button>
      ))}
      {asked && (
        <AskedDialog
          of={asked}
          onAction={(action) => setAsked({ ...asked, offer: action })}
          onEnd={() => setAsked(null)}
        />
      )}
    </p>
  );
}

export function Rigs(props: { caller: Caller | null; version: number }) {
  const query = useAddress().searchParams;
  const filter = query.get('filter') ?? '';
  const withAlarms = query.get('with_alarms') === 'true';
  const isChosen = filter.trim() !== '' || withAlarms;
  return (
    <ListPage
      title="Rigs"
      path="activity"
      items={(response: ListActivityResponse) => response.rigs}
      query={['filter', 'with_alarms']}
      order={['name', 'asc']}
      version={props.version}
      columns={kColumns}
      next="Next rigs"
      empty={<Nothing filter={filter} withAlarms={withAlarms} />}
      above={(mistake) => (
        <>
          <form class="bar" role="search" onSubmit={(event) => event.preventDefault()}>
            <RigFilter label="Filter" parameter="filter" />
            <label>
              <input
                type="checkbox"
                checked={withAlarms}
                onChange={(event) =>
                  go(
                    withQuery({
                      with_alarms: event.currentTarget.checked ? 'true' : '',
                      order_by: event.currentTarget.checked ? 'alarms desc' : '',
                      page_token: '',
                    }),
                    true,
                  )
                }
              />
              only with alarms, the most urgent first
            </label>
            {mistake && <Problem error={mistake} />}
          </form>
          {isChosen && !mistake && mayAdminister(props.caller) && (
            <Administration filter={filter} withAlarms={withAlarms} />
          )}
        </>
      )}
    />
  );
}
