// A list that the daemon returns in pages. The address has the position in the
// list and the query.
import type { ComponentChildren } from 'preact';
import { useMemo } from 'preact/hooks';
import type { ApiError } from './api';
import { filterOf, type Menu } from './list_filter';
import { Empty, Link, Loaded, Title } from './parts';
import { useAddress, useRead, withQuery } from './state';
import { DataTable, type Column, type OrderLink } from './table';

type SortDirection = 'asc' | 'desc';

// Items that are read at a time, unless the address has page_size: the goal of
// 50 ms is for pages of this size.
export const kPageSize = '50';

interface Listing<R, T> {
  path: string;
  items: (response: R) => T[];
  query?: string[]; // query parameters of the address that go to the daemon
  menus?: Menu[]; // of the filter, if the list has that of list_filter.tsx
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

// Sorts by the column; reverses the order if it is the present one.
function linkOf(column: string, now: [string, SortDirection], first: SortDirection): OrderLink {
  const [field, direction] = now;
  const current = field === column;
  const next = !current ? first : direction === 'asc' ? 'desc' : 'asc';
  return {
    to: withQuery({ order_by: `${column} ${next}`, page_token: '' }),
    sorted: !current ? 'none' : direction === 'asc' ? 'ascending' : 'descending',
  };
}

// States that the list lacks items in its order, if it does.
function LeftOut<T>(props: { columns: Column<T>[]; order: string }) {
  const sorted = props.columns.find(({ order }) => order === props.order);
  if (!sorted?.partial) return null;
  return <p class="quiet">Rows without a value in the sorted column are not listed.</p>;
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

function Items<R, T extends object>(
  props: Listing<R, T> & { title: string; response: R; whole: boolean },
) {
  const address = useAddress().searchParams;
  const { response, items: itemsOf } = props;
  // The response is what changes; callers pass new but equal functions.
  // eslint-disable-next-line react-hooks/exhaustive-deps
  const items = useMemo(() => itemsOf(response), [response]);
  const orders = props.columns.map(({ order }) =>
    order && props.order ? linkOf(order, orderOf(address, props.order), props.order[1]) : undefined,
  );
  return (
    <DataTable
      caption={props.title}
      columns={props.columns}
      items={items}
      orders={orders}
      whole={props.whole}
    />
  );
}

export function ListPage<R extends { nextPageToken: string }, T extends object>(
  props: Listing<R, T> & { title: string },
) {
  const address = useAddress().searchParams;
  const query = new URLSearchParams(props.fixed);
  for (const key of ['page_token', ...(props.query ?? [])]) {
    const value = address.get(key);
    if (value) query.set(key, value);
  }
  if (props.menus) {
    const filter = filterOf(address, props.menus);
    if (filter) query.set('filter', filter);
  }
  query.set('page_size', address.get('page_size') ?? kPageSize);
  if (props.order) {
    query.set('order_by', address.get('order_by') || props.order.join(' '));
  }
  const read = useRead<R>(`${props.path}?${query}`, props.version);
  const token = address.get('page_token') ?? '';
  const mistake = props.above && read.error?.code === 'INVALID_ARGUMENT' ? read.error : null;
  return (
    <>
      <Title text={props.title}>{props.title}</Title>
      {props.above?.(mistake)}
      {props.order && !mistake && (
        <LeftOut columns={props.columns} order={orderOf(address, props.order)[0]} />
      )}
      {!mistake && (
        <Loaded read={read}>
          {(listed) => {
            if (props.items(listed).length === 0) return <Empty>{props.empty}</Empty>;
            return (
              <>
                <Items {...props} response={listed} whole={!token && !listed.nextPageToken} />
                <Pager next={props.next} token={token} more={listed.nextPageToken} />
              </>
            );
          }}
        </Loaded>
      )}
    </>
  );
}
