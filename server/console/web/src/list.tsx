// A list that the daemon hands out in pages. Where one is in it, and what is
// asked for, stands in the address.
import type { ComponentChildren } from 'preact';
import { DataTable, Empty, Link, Loaded, Title } from './parts';
import { useAddress, useRead, withQuery } from './state';

export interface Column<T> {
  head: string;
  cell: (item: T) => ComponentChildren;
}

interface Listing<T> {
  path: string; // under /api/v1
  items: string; // what the answer calls them
  query?: string[]; // of the address, that the daemon works out
  version: number;
  columns: Column<T>[]; // the first names the item
  next: string; // what the link to the next page says
  empty: ComponentChildren;
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

// `children` stand above the table.
export function ListPage<T>(
  props: Listing<T> & { title: string; children?: ComponentChildren },
) {
  const address = useAddress().searchParams;
  const asked = ['page_token', ...(props.query ?? [])].map((key): [string, string] => [
    key,
    address.get(key) ?? '',
  ]);
  const read = useRead<Record<string, unknown> & { nextPageToken: string }>(
    `${props.path}?${new URLSearchParams(asked)}`,
    props.version,
  );
  return (
    <>
      <Title text={props.title}>{props.title}</Title>
      {props.children}
      <Loaded read={read}>
        {(listed) => {
          const items = listed[props.items] as T[];
          if (items.length === 0) return <Empty>{props.empty}</Empty>;
          return (
            <>
              <DataTable
                caption={props.title}
                head={props.columns.map((column) => column.head)}
                rows={items.map((item) => props.columns.map((column) => column.cell(item)))}
              />
              <Pager
                next={props.next}
                token={address.get('page_token') ?? ''}
                more={listed.nextPageToken}
              />
            </>
          );
        }}
      </Loaded>
    </>
  );
}
