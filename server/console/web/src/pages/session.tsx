// The list of sessions, and the page of one session with the device's path.
import { useState } from 'preact/hooks';
import { idOf, rigPath } from '../api';
import type {
  ListSegmentsResponse,
  ListSessionsResponse,
  Rig,
  Session,
  TrajectorySegment,
} from '../contract';
import { number } from '../format';
import { ListPage } from '../list';
import { Figures, Link, Loaded, NameLink, SegmentLink, Title, When } from '../parts';
import { useRead } from '../state';
import { DataTable, type Column } from '../table';
import { ColouredPath, entropyOf, isKept, useSessionPath, type SessionPath } from '../session_path';

function Kept(props: { sessionPath: SessionPath; group: string }) {
  const { segments } = props.sessionPath;
  const kept = segments
    .filter(isKept)
    .sort((a, b) => entropyOf(a, props.group) - entropyOf(b, props.group));
  if (kept.length === 0) {
    return <p>No segment of this session is in a table now.</p>;
  }
  const start = BigInt(segments[0].startNs);
  const startOf = (segment: TrajectorySegment) => Number(BigInt(segment.startNs) - start) / 1e9;
  const columns: Column<TrajectorySegment>[] = [
    {
      head: 'Segment',
      cell: (segment) => <SegmentLink name={segment.segment} />,
      value: (segment) => decodeURIComponent(idOf(segment.segment)),
    },
    {
      head: `Entropy of ${props.group} [nat]`,
      cell: (segment) => number(entropyOf(segment, props.group), 4),
      value: (segment) => entropyOf(segment, props.group),
    },
    {
      head: 'Kept for',
      cell: (segment) => segment.tables.join(', '),
      value: (segment) => segment.tables.join(', '),
    },
    {
      head: 'Start [s]',
      cell: (segment) => number(startOf(segment), 4),
      value: startOf,
    },
  ];
  return (
    <DataTable
      caption="Segments of this session that are kept, most informative first"
      columns={columns}
      items={kept}
    />
  );
}

function PathAndKept(props: { sessionPath: SessionPath; groups: string[] }) {
  const [group, setGroup] = useState(props.groups[0]);
  return (
    <>
      <ColouredPath
        sessionPath={props.sessionPath}
        groups={props.groups}
        group={group}
        onGroup={setGroup}
      />
      <h2>Kept segments</h2>
      <Kept sessionPath={props.sessionPath} group={group} />
    </>
  );
}

// Reads the path of a session and the groups of its rig.
function usePathAndGroups(rig: string, session: string, version: number) {
  const sessionPath = useSessionPath(
    `${rigPath(rig)}/sessions/${encodeURIComponent(session)}`,
    version,
  );
  const described = useRead<Rig>(rigPath(rig));
  const groups = described.value?.groups.map((g) => g.group);
  return {
    value: sessionPath.value && groups ? { sessionPath: sessionPath.value, groups } : null,
    error: sessionPath.error ?? described.error,
  };
}

// `session` is encoded as in the names of its segments.
export function SessionPage(props: { rig: string; session: string; version: number }) {
  const read = usePathAndGroups(props.rig, props.session, props.version);
  const title = 'Session ' + decodeURIComponent(props.session);
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {({ sessionPath, groups }) => (
          <>
            <Figures
              of={[
                ['Segments', sessionPath.session.segments],
                ['Kept', sessionPath.segments.filter(isKept).length],
                ['Oldest segment', <When time={sessionPath.session.firstReceiveTime} />],
                ['Newest segment', <When time={sessionPath.session.lastReceiveTime} />],
              ]}
            />
            <PathAndKept sessionPath={sessionPath} groups={groups} />
          </>
        )}
      </Loaded>
    </>
  );
}

// The session of the newest segment, for the page of a rig.
function Newest(props: { rig: string; session: string; version: number }) {
  const [group, setGroup] = useState<string | null>(null);
  const read = usePathAndGroups(props.rig, props.session, props.version);
  return (
    <Loaded read={read}>
      {({ sessionPath, groups }) => (
        <>
          <p>
            <NameLink name={sessionPath.session.name}>{sessionPath.session.session}</NameLink>:{' '}
            {sessionPath.session.segments} segments, of which{' '}
            {sessionPath.segments.filter(isKept).length} are kept.
          </p>
          <ColouredPath
            sessionPath={sessionPath}
            groups={groups}
            group={group ?? groups[0]}
            onGroup={setGroup}
          />
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
  {
    head: 'Session',
    cell: (s) => <NameLink name={s.name}>{s.session}</NameLink>,
    value: (s) => s.session,
  },
  { head: 'Segments', cell: (s) => s.segments, value: (s) => Number(s.segments) },
  {
    head: 'Oldest segment',
    cell: (s) => <When time={s.firstReceiveTime} />,
    value: (s) => Date.parse(s.firstReceiveTime ?? ''),
  },
  {
    head: 'Newest segment',
    cell: (s) => <When time={s.lastReceiveTime} />,
    value: (s) => Date.parse(s.lastReceiveTime ?? ''),
  },
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
      empty="No segment has arrived yet. Send some with the client library or with selfcal segment import."
    />
  );
}
