// The list of sessions, and the page of one session with the device's path.
import { useState } from 'preact/hooks';
import { idOf, pageOf, rigPath } from '../api';
import type { ListSegmentsResponse, ListSessionsResponse, Rig, Session } from '../contract';
import { number } from '../format';
import { ListPage, type Column } from '../list';
import { DataTable, Figures, Link, Loaded, SegmentLink, Title, When } from '../parts';
import { useRead } from '../state';
import { ColouredWay, entropyOf, isKept, useWay, type Way } from '../way';

function Kept(props: { way: Way; group: string }) {
  const { segments } = props.way;
  const kept = segments
    .filter(isKept)
    .sort((a, b) => entropyOf(a, props.group) - entropyOf(b, props.group));
  if (kept.length === 0) {
    return <p>No segment of this session is in a table now.</p>;
  }
  const start = BigInt(segments[0].startNs);
  return (
    <DataTable
      caption="Segments of this session that are kept, most informative first"
      head={['Segment', `Entropy of ${props.group} [nats]`, 'Kept for', 'Starts at [s]']}
      rows={kept.map((segment) => [
        <SegmentLink name={segment.segment} />,
        number(entropyOf(segment, props.group), 4),
        segment.tables.join(', '),
        number(Number(BigInt(segment.startNs) - start) / 1e9, 4),
      ])}
    />
  );
}

function WayAndKept(props: { way: Way; groups: string[] }) {
  const [group, setGroup] = useState(props.groups[0]);
  return (
    <>
      <ColouredWay way={props.way} groups={props.groups} group={group} onGroup={setGroup} />
      <h2>Kept segments</h2>
      <Kept way={props.way} group={group} />
    </>
  );
}

// Reads the path of a session and the groups of its rig.
function useWayAndGroups(rig: string, session: string, version: number) {
  const way = useWay(`${rigPath(rig)}/sessions/${encodeURIComponent(session)}`, version);
  const described = useRead<Rig>(rigPath(rig));
  const groups = described.value?.groups.map((g) => g.group);
  return {
    value: way.value && groups ? { way: way.value, groups } : null,
    error: way.error ?? described.error,
  };
}

// `session` is encoded as in the names of its segments.
export function SessionPage(props: { rig: string; session: string; version: number }) {
  const read = useWayAndGroups(props.rig, props.session, props.version);
  const title = 'Session ' + decodeURIComponent(props.session);
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {({ way, groups }) => (
          <>
            <Figures
              of={[
                ['Segments', way.session.segments],
                ['Kept', way.segments.filter(isKept).length],
                ['Started', <When time={way.session.firstReceiveTime} />],
                ['Newest', <When time={way.session.lastReceiveTime} />],
              ]}
            />
            <WayAndKept way={way} groups={groups} />
          </>
        )}
      </Loaded>
    </>
  );
}

// The session of the newest segment, for the page of a rig.
function Newest(props: { rig: string; session: string; version: number }) {
  const [group, setGroup] = useState<string | null>(null);
  const read = useWayAndGroups(props.rig, props.session, props.version);
  return (
    <Loaded read={read}>
      {({ way, groups }) => (
        <>
          <p>
            <Link to={pageOf(way.session.name)}>{way.session.session}</Link>: {way.session.segments}{' '}
            segments, of which {way.segments.filter(isKept).length} are kept.
          </p>
          <ColouredWay way={way} groups={groups} group={group ?? groups[0]} onGroup={setGroup} />
        </>
      )}
    </Loaded>
  );
}

export function sessionOf(segment: string): string {
  return idOf(segment).split('~')[0];
}

export function NewestSession(props: { rig: string; version: number }) {
  const read = useRead<ListSegmentsResponse>(
    rigPath(props.rig) + '/segments?page_size=1&view=BASIC',
    props.version,
  );
  const newest = read.value?.segments[0]?.name;
  if (!newest) return null;
  return (
    <>
      <h2>Newest session</h2>
      <Newest
        key={sessionOf(newest)}
        rig={props.rig}
        session={sessionOf(newest)}
        version={props.version}
      />
      <p>
        <Link to={`/rigs/${props.rig}/sessions`}>All sessions</Link>
      </p>
    </>
  );
}

const kColumns: Column<Session>[] = [
  { head: 'Session', cell: (s) => <Link to={pageOf(s.name)}>{s.session}</Link> },
  { head: 'Segments', cell: (s) => s.segments },
  { head: 'Started', cell: (s) => <When time={s.firstReceiveTime} /> },
  { head: 'Newest segment', cell: (s) => <When time={s.lastReceiveTime} /> },
];

export function Sessions(props: { rig: string; version: number }) {
  return (
    <ListPage
      title={'Sessions of ' + props.rig}
      path={rigPath(props.rig) + '/sessions'}
      items={(response: ListSessionsResponse) => response.sessions}
      version={props.version}
      columns={kColumns}
      next="Next sessions"
      empty="No segment has arrived yet. Send some with the client library or with selfcal import."
    />
  );
}
