// The segments of a rig or of many rigs, filtered and sorted.
import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { idOf, rigOf, rigPath, type ApiError } from '../api';
import type { GroupScore, ListRigsResponse, ListSegmentsResponse, Rig, Segment } from '../contract';
import { RigChoice, kRigFilter, rigColumn } from '../fleet';
import { bytes, number, words } from '../format';
import { ListPage, kPageSize, orderOf } from '../list';
import { Badge, Choice, Link, SegmentLink, When } from '../parts';
import { go, useAddress, useRead, withQuery } from '../state';
import type { Column } from '../table';

function kept(segment: Segment): string {
  const tables = segment.scores.filter((s) => s.inTable).map((s) => s.group);
  return tables.length > 0 ? tables.join(', ') : 'none';
}

// The columns, with the score for one group.
function columns(group: string, acrossRigs: boolean): Column<Segment>[] {
  const of = (segment: Segment, show: (score: GroupScore) => string) => {
    const score = segment.scores.find((s) => s.group === group);
    return score ? show(score) : '';
  };
  return [
    {
      head: 'Segment',
      cell: (segment) => <SegmentLink name={segment.name} />,
      value: (segment) => decodeURIComponent(idOf(segment.name)),
    },
    ...(acrossRigs ? [rigColumn((segment: Segment) => rigOf(segment.name))] : []),
    {
      head: 'Received',
      cell: (segment) => <When time={segment.receiveTime} />,
      order: 'receive_time',
    },
    {
      head: 'State',
      cell: (segment) => (
        <>
          <Badge state={segment.state} />
          {segment.state === 'UNUSABLE' && <span class="reason">{segment.problem}</span>}
        </>
      ),
      value: (segment) => words(segment.state),
    },
    { head: 'Kept in tables', cell: kept, value: kept },
    {
      head: 'Gain [nat]',
      cell: (segment) => of(segment, (score) => number(score.gainNats)),
      order: 'gain.' + group,
    },
    {
      head: 'Entropy [nat]',
      cell: (segment) => of(segment, (score) => number(score.entropyNats, 4)),
      order: 'entropy.' + group,
    },
    { head: 'Landmarks', cell: (segment) => segment.landmarks, order: 'landmarks' },
    { head: 'Observations', cell: (segment) => segment.observations, order: 'observations' },
    {
      head: 'Reprojection error [px]',
      cell: (segment) => (segment.residuals ? number(segment.residuals.reprojectionRmsPx) : ''),
      value: (segment) => segment.residuals?.reprojectionRmsPx,
    },
    {
      head: 'Temperature [°C]',
      cell: (segment) => (segment.temperatureC === undefined ? '' : number(segment.temperatureC)),
      order: 'temperature_c',
    },
    {
      head: 'Data',
      cell: (segment) => (segment.hasData ? bytes(segment.payloadBytes) : 'dropped'),
      value: (segment) => (segment.hasData ? Number(segment.payloadBytes) : undefined),
    },
  ];
}

function Help(props: { group: string }) {
  const examples = [
    'state = UNUSABLE',
    `in_table = ${props.group} AND gain.${props.group} >= 2`,
    'has_data = true AND landmarks < 40',
    'receive_time >= 2026-11-21T04:00:00Z',
  ];
  return (
    <details>
      <summary>Filter syntax</summary>
      <p>Conditions joined by AND; a segment has to meet all of them.</p>
      <ul>
        <li>
          With <code>=</code>: <code>state</code> (STORED, SCORED or UNUSABLE), <code>session</code>
          , <code>has_data</code> (true or false), <code>in_table</code> (a group).
        </li>
        <li>
          With <code>=</code> <code>&lt;</code> <code>&lt;=</code> <code>&gt;</code>{' '}
          <code>&gt;=</code>: <code>receive_time</code>, <code>calibration_version</code>,{' '}
          <code>landmarks</code>, <code>observations</code>, <code>temperature_c</code>,{' '}
          <code>gain.GROUP</code> and <code>entropy.GROUP</code>, where GROUP is a group.
        </li>
        <li>Enclose a value with spaces or other special characters in double quotes.</li>
      </ul>
      <p>
        Examples:{' '}
        {examples.map((example, i) => (
          <>
            {i > 0 && ', '}
            <Link to={withQuery({ filter: example, page_token: '' })}>
              <code>{example}</code>
            </Link>
          </>
        ))}
        .
      </p>
    </details>
  );
}

function Filter(props: { mistake: ApiError | null; group: string; groups: string[] }) {
  const address = useAddress().searchParams;
  const filter = address.get('filter') ?? '';
  const [draft, setDraft] = useState(filter);
  useEffect(() => setDraft(filter), [filter]);
  const show = (text: string) => go(withQuery({ filter: text.trim(), page_token: '' }));
  const edit = (event: JSX.TargetedInputEvent<HTMLInputElement>) => {
    setDraft(event.currentTarget.value);
    if (event.currentTarget.value === '' && filter !== '') show('');
  };
  const submit = (event: JSX.TargetedSubmitEvent<HTMLFormElement>) => {
    event.preventDefault();
    show(draft);
  };
  // A list sorted by the score of a group is then sorted by that of the new group.
  const choose = (group: string) =>
    go(
      withQuery({
        group,
        order_by: (address.get('order_by') ?? '').replace(/^(gain|entropy)\.\S+/, '$1.' + group),
        page_token: '',
      }),
    );
  return (
    <form role="search" onSubmit={submit}>
      <div class="bar">
        <label class="wide">
          Filter
          <input
            type="search"
            value={draft}
            placeholder="all segments"
            spellcheck={false}
            aria-invalid={props.mistake !== null}
            aria-describedby="filter-mistake"
            onInput={edit}
          />
        </label>
        <button type="submit">Show</button>
        {props.groups.length > 0 && (
          <Choice
            label="Scores of"
            value={props.group}
            of={props.groups.map((name) => [name, name])}
            onChoice={choose}
          />
        )}
      </div>
      <p id="filter-mistake" class="mistake" role="alert">
        {props.mistake?.message}
      </p>
      <Help group={props.group} />
    </form>
  );
}

const kNewestFirst: ['receive_time', 'desc'] = ['receive_time', 'desc'];

// Fields that not every segment has.
const kNotOfAll = /^(gain|entropy|temperature_c)\b/;

function Nothing(props: { rig: string; filter: string; order: string }) {
  if (props.filter || props.order !== kNewestFirst[0]) {
    return (
      <p>
        No segment matches.{' '}
        <Link to={withQuery({ filter: '', order_by: '', page_token: '' })}>
          Show all, newest first
        </Link>
      </p>
    );
  }
  if (!props.rig) return <p>None of these rigs has a segment.</p>;
  return (
    <p>
      No segment has arrived yet. Send some with the client library, or{' '}
      <code>selfcal segment import {props.rig} DIR</code>.
    </p>
  );
}

// The groups of the rigs, each once.
function groupsOf(rigs: Rig[]): string[] {
  return [...new Set(rigs.flatMap((rig) => rig.groups.map((g) => g.group)))];
}

// The segments of one rig, or of those of a filter if `rig` is ''.
function SegmentList(props: { rig: string; groups: string[]; version: number }) {
  const address = useAddress().searchParams;
  const { rig, groups } = props;
  const group = address.get('group') ?? groups[0] ?? '';
  const [order] = orderOf(address, kNewestFirst);
  const shown = useMemo(() => columns(group, !rig), [group, rig]);
  return (
    <ListPage
      title={rig ? 'Segments of ' + rig : 'Segments'}
      path={rig ? rigPath(rig) + '/segments' : 'segments'}
      items={(response: ListSegmentsResponse) => response.segments}
      query={rig ? ['filter'] : ['filter', kRigFilter]}
      fixed={{ view: 'BASIC' }}
      order={kNewestFirst}
      version={props.version}
      columns={shown}
      next="Next segments"
      empty={<Nothing rig={rig} filter={address.get('filter') ?? ''} order={order} />}
      above={(mistake) => {
        const isOfRigs = mistake?.message.startsWith(kRigFilter) ?? false;
        return (
          <>
            {!rig && <RigChoice mistake={isOfRigs ? mistake : null} />}
            <Filter mistake={isOfRigs ? null : mistake} group={group} groups={groups} />
            {kNotOfAll.test(order) && !mistake && (
              <p class="quiet">Segments without a value in the sorted column are not listed.</p>
            )}
          </>
        );
      }}
    />
  );
}

export function Segments(props: { rig: string; version: number }) {
  const rig = useRead<Rig>(rigPath(props.rig));
  return <SegmentList {...props} groups={groupsOf(rig.value ? [rig.value] : [])} />;
}

// Offers the groups of the first rigs of the filter: devices that are looked at
// together have the same.
export function FleetSegments(props: { version: number }) {
  const filter = useAddress().searchParams.get(kRigFilter) ?? '';
  const query = new URLSearchParams({ filter, page_size: kPageSize });
  const rigs = useRead<ListRigsResponse>('rigs?' + query.toString());
  return <SegmentList {...props} rig="" groups={groupsOf(rigs.value?.rigs ?? [])} />;
}
