// The segments of a rig or of many rigs, filtered and sorted.
import { useMemo } from 'preact/hooks';
import { idOf, rigOf, rigPath } from '../api';
import {
  Segment_State,
  TableExclusion_Cause,
  type GroupScore,
  type ListRigsResponse,
  type ListSegmentsResponse,
  type Rig,
  type Segment,
} from '../contract';
import { kRigFilter, rigColumn } from '../fleet';
import { bytes, number, words } from '../format';
import { ListPage, kPageSize } from '../list';
import {
  ListFilter,
  NoMatch,
  isNarrowed,
  valuesOf,
  type FilterSyntax,
  type Menu,
} from '../list_filter';
import { Badge, Choice, SegmentLink, When } from '../parts';
import { go, useAddress, useRead, withQuery } from '../state';
import type { Column } from '../table';

function kept(segment: Segment): string {
  const tables = segment.scores.filter((s) => s.inTable).map((s) => s.group);
  return tables.length > 0 ? tables.join(', ') : 'none';
}

// A number that not every segment has, by which the daemon sorts.
function quantity(
  head: string,
  order: string,
  of: (segment: Segment) => number | undefined,
): Column<Segment> {
  const show = (segment: Segment) => {
    const value = of(segment);
    return value === undefined ? '' : number(value);
  };
  return { head, cell: show, order, partial: true };
}

// The columns, with the score for one group. The daemon sorts the segments of all
// rigs by fewer of them than those of one.
function columns(group: string, acrossRigs: boolean): Column<Segment>[] {
  const of = (segment: Segment, show: (score: GroupScore) => string) => {
    const score = segment.scores.find((s) => s.group === group);
    return score ? show(score) : '';
  };
  const ofOneRig = (order: string) => (acrossRigs ? undefined : order);
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
      partial: true,
    },
    {
      head: 'Entropy [nat]',
      cell: (segment) => of(segment, (score) => number(score.entropyNats, 4)),
      order: ofOneRig('entropy.' + group),
      partial: true,
    },
    { head: 'Landmarks', cell: (segment) => segment.landmarks, order: ofOneRig('landmarks') },
    {
      head: 'Observations',
      cell: (segment) => segment.observations,
      order: ofOneRig('observations'),
    },
    {
      head: 'Reprojection error [px]',
      cell: (segment) => (segment.residuals ? number(segment.residuals.reprojectionRmsPx) : ''),
      value: (segment) => segment.residuals?.reprojectionRmsPx,
    },
    quantity('Temperature [°C]', 'temperature_c', (segment) => segment.temperatureC),
    quantity('Angular rate [rad/s]', 'angular_rate', (segment) => segment.motion?.angularRate),
    quantity('Acceleration [m/s²]', 'acceleration', (segment) => segment.motion?.acceleration),
    {
      head: 'Data',
      cell: (segment) => (segment.hasData ? bytes(segment.payloadBytes) : 'dropped'),
      value: (segment) => (segment.hasData ? Number(segment.payloadBytes) : undefined),
    },
  ];
}

const kMenus: Menu[] = [
  { name: 'state', label: 'State', of: valuesOf(Segment_State) },
  { name: 'excluded', label: 'Exclusion', of: valuesOf(TableExclusion_Cause) },
];

// The filter, with examples for one group.
function syntaxOf(group: string): FilterSyntax {
  return {
    items: 'segments',
    equal: [
      ['state', kMenus[0].of.join(', ')],
      ['session'],
      ['has_data', 'true or false'],
      ['in_table', 'a group'],
      ['excluded', kMenus[1].of.join(', ')],
    ],
    compared: [
      ['receive_time'],
      ['calibration_version'],
      ['landmarks'],
      ['observations'],
      ['temperature_c', '°C'],
      ['angular_rate', 'rad/s'],
      ['acceleration', 'm/s²'],
      ['gain.GROUP', 'nat'],
      ['entropy.GROUP', 'nat'],
    ],
    note: 'GROUP is the name of a group.',
    examples: [
      'state = UNUSABLE',
      `in_table = ${group} AND gain.${group} >= 2`,
      'has_data = true AND landmarks < 40',
      'receive_time >= 2026-11-21T04:00:00Z',
      'angular_rate >= 0.5 AND acceleration < 2',
    ],
  };
}

// Chooses the group whose scores are shown. A list sorted by the score of a group
// is then sorted by that of the new group.
function GroupChoice(props: { group: string; of: string[] }) {
  const order = useAddress().searchParams.get('order_by') ?? '';
  if (props.of.length === 0) return null;
  return (
    <Choice
      label="Scores of"
      value={props.group}
      of={props.of.map((name) => [name, name])}
      onChoice={(group) =>
        go(
          withQuery({
            group,
            order_by: order.replace(/^(gain|entropy)\.\S+/, '$1.' + group),
            page_token: '',
          }),
        )
      }
    />
  );
}

const kNewestFirst: ['receive_time', 'desc'] = ['receive_time', 'desc'];

function Nothing(props: { rig: string }) {
  if (isNarrowed(useAddress().searchParams, kMenus)) {
    return <NoMatch item="segment" menus={kMenus} />;
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
  const shown = useMemo(() => columns(group, !rig), [group, rig]);
  return (
    <ListPage
      title={rig ? 'Segments of ' + rig : 'Segments'}
      path={rig ? rigPath(rig) + '/segments' : 'segments'}
      items={(response: ListSegmentsResponse) => response.segments}
      query={rig ? [] : [kRigFilter]}
      menus={kMenus}
      fixed={{ view: 'BASIC' }}
      order={kNewestFirst}
      version={props.version}
      columns={shown}
      next="Next segments"
      empty={<Nothing rig={rig} />}
      above={(mistake) => (
        <ListFilter mistake={mistake} acrossRigs={!rig} syntax={syntaxOf(group)} menus={kMenus}>
          <GroupChoice group={group} of={groups} />
        </ListFilter>
      )}
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
