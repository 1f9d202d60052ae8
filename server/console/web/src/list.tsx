// A list that the daemon hands out in pages. Where one is in it, and what is
// asked for, stands in the address.
import type { ComponentChildren } from 'preact';
import type { ApiError } from './api';
import { DataTable, Empty, Link, Loaded, Title } from './parts';
import { useAddress, useRead, withQuery } from './state';

type Way = 'asc' | 'desc';

export interface Column<T> {
  head: string;
  cell: (item: T) => ComponentChildren;
  order?: string; // what order_by calls it, where it can be sorted by
}

interface Listing<T> {
  path: string; // under /api/v1
  items: string; // what the answer calls them
  query?: string[]; // of the address, that the daemon works out
  order?: [string, Way]; // without order_by in the address
  version: number;
  columns: Column<T>[]; // the first names the item
  next: string; // what the link to the next page says
  empty: ComponentChildren;
  // Stands above the table; told what the daemon says of a request that it
  // cannot read.
  above?: (mistake: ApiError | null) => ComponentChildren;
}

// By what a list is sorted, as the address has it.
export function orderOf(address: URLSearchParams, without: [string, Way]): [string, Way] {
  const [field, way] = (address.get('order_by') ?? '').split(' ');
  if (!field) return without;
  return [field, way === 'asc' || way === 'desc' ? way : without[1]];
}

// Sorts by the column; where that is done already, the other way.
function SortBy(props: { column: string; head: string; now: [string, Way]; first: Way }) {
  const [field, way] = props.now;
  const current = field === props.column;
  const next = !current ? props.first : way === 'asc' ? 'desc' : 'asc';
  return (
    <Link to={withQuery({ order_by: `${props.column} ${next}`, page_token: '' })}>
      {props.head}
      <span aria-hidden="true">{current ? (way === 'asc' ? ' ▲' : ' ▼') : ''}</span>
    </Link>
  );
}

// To the next page and to the first one.
function Pager(props: { next: string; token: string; more: string }) {
  if (!props.token && !props.more) return null;
  return (
    <nav class="pager" aria-label="Pages">
      {props.token && <Link to={withQuery({ page_token: '' })}>First page</Link>}
      {props.more && <Link to={withQuery({ page_token: props.more })}>{props.next}</Link>}
    </nav>
  );
}

function Items<T>(props: Listing<T> & { title: string; items: string; of: T[] }) {
  const address = useAddress().searchParams;
  const heads = props.columns.map(({ head, order }) => {
    if (!order || !props.order) return { text: head };
    const now = orderOf(address, props.order);
    const sorted = now[0] === order ? (now[1] === 'asc' ? 'ascending' : 'descending') : 'none';
    return {
      text: <SortBy column={order} head={head} now={now} first={props.order[1]} />,
      sorted: sorted as 'ascending' | 'descending' | 'none',
    };
  });
  return (
    <DataTable
      caption={props.title}
      head={heads.map((head) => head.text)}
      sorted={heads.map((head) => head.sorted)}
      rows={props.of.map((item) => props.columns.map((column) => column.cell(item)))}
    />
  );
}

export function ListPage<T>(props: Listing<T> & { title: string }) {
  const address = useAddress().searchParams;
  const asked = ['page_token', ...(props.query ?? [])].map((key): [string, string] => [
    key,
    address.get(key) ?? '',
  ]);
  const read = useRead<Record<string, unknown> & { nextPageToken: string }>(
    `${props.path}?${new URLSearchParams(asked)}`,
    props.version,
  );
  const mistake = props.above && read.error?.code === 'INVALID_ARGUMENT' ? read.error : null;
  return (
    <>
      <Title text={props.title}>{props.title}</Title>
      {props.above?.(mistake)}
      {!mistake && (
        <Loaded read={read}>
          {(listed) => {
            const items = listed[props.items] as T[];
            if (items.length === 0) return <Empty>{props.empty}</Empty>;
            return (
              <>
                <Items {...props} of={items} />
                <Pager
                  next={props.next}
                  token={address.get('page_token') ?? ''}
                  more={listed.nextPageToken}
                />
              </>
            );
          }}
        </Loaded>
      )}
    </>
  );
}
