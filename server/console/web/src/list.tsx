// A list that the daemon returns in pages. The address has the position in the
// list and the query.
import type { ComponentChildren } from 'preact';
import type { ApiError } from './api';
import { DataTable, Empty, Link, Loaded, Title } from './parts';
import { useAddress, useRead, withQuery } from './state';

type SortDirection = 'asc' | 'desc';

export interface Column<T> {
  head: string;
  cell: (item: T) => ComponentChildren;
  order?: string; // its name in order_by, if the list can be sorted by it
}

interface Listing<R, T> {
  path: string;
  items: (response: R) => T[];
  query?: string[]; // query parameters of the address that go to the daemon
  fixed?: Record<string, string>; // query parameters that are not in the address
  // Default of the query parameter order_by; without it the list has none.
  order?: [string, SortDirection];
  version: number;
  columns: Column<T>[]; // the first names the item
  next: string; // text of the link to the next page
  empty: ComponentChildren;
  // Content above the table. Gets the daemon's error if the request is invalid.
  above?: (mistake: ApiError | null) => ComponentChildren;
}

// The order of a list, from the address.
export function orderOf(
  address: URLSearchParams,
  without: [string, SortDirection],
): [string, SortDirection] {
  const [field, direction] = (address.get('order_by') ?? '').split(' ');
  if (!field) return without;
  return [field, direction === 'asc' || direction === 'desc' ? direction : without[1]];
}

// A link that sorts by the column; reverses the order if it is the present one.
function SortBy(props: {
  column: string;
  head: string;
  now: [string, SortDirection];
  first: SortDirection;
}) {
  const [field, direction] = props.now;
  const current = field === props.column;
  const next = !current ? props.first : direction === 'asc' ? 'desc' : 'asc';
  return (
    <Link to={withQuery({ order_by: `${props.column} ${next}`, page_token: '' })}>
      {props.head}
      <span aria-hidden="true">{current ? (direction === 'asc' ? ' ▲' : ' ▼') : ''}</span>
    </Link>
  );
}

// Links to the next page and to the first page.
function Pager(props: { next: string; token: string; more: string }) {
  if (!props.token && !props.more) return null;
  return (
    <nav class="pager" aria-label="Pages">
      {props.token && <Link to={withQuery({ page_token: '' })}>First page</Link>}
      {props.more && <Link to={withQuery({ page_token: props.more })}>{props.next}</Link>}
    </nav>
  );
}

function Items<R, T>(props: Listing<R, T> & { title: string; of: T[] }) {
  const address = useAddress().searchParams;
  const heads = props.columns.map(({ head, order }) => {
    if (!order || !props.order) return { text: head };
    const now = orderOf(address, props.order);
    const sorted: 'ascending' | 'descending' | 'none' =
      now[0] === order ? (now[1] === 'asc' ? 'ascending' : 'descending') : 'none';
    return {
      text: <SortBy column={order} head={head} now={now} first={props.order[1]} />,
      sorted,
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

export function ListPage<R extends { nextPageToken: string }, T>(
  props: Listing<R, T> & { title: string },
) {
  const address = useAddress().searchParams;
  const query = new URLSearchParams(props.fixed);
  for (const key of ['page_token', ...(props.query ?? [])]) {
    query.set(key, address.get(key) ?? '');
  }
  if (props.order) {
    query.set('order_by', address.get('order_by') || props.order.join(' '));
  }
  const read = useRead<R>(`${props.path}?${query}`, props.version);
  const mistake = props.above && read.error?.code === 'INVALID_ARGUMENT' ? read.error : null;
  return (
    <>
      <Title text={props.title}>{props.title}</Title>
      {props.above?.(mistake)}
      {!mistake && (
        <Loaded read={read}>
          {(listed) => {
            const items = props.items(listed);
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
