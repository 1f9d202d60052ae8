// A table that the reader can sort and filter. Of a long table only the rows in
// view are in the page.
import {
  columnFilteringFeature,
  createFilteredRowModel,
  createSortedRowModel,
  filterFn_includesString,
  globalFilteringFeature,
  rowSortingFeature,
  sortFn_alphanumeric,
  sortFn_basic,
  tableFeatures,
  useTable,
  type ColumnDef,
  type SortingState,
} from '@tanstack/preact-table';
import {
  elementScroll,
  observeElementOffset,
  observeElementRect,
  Virtualizer,
} from '@tanstack/virtual-core';
import type { ComponentChildren, JSX, RefObject } from 'preact';
import { useEffect, useLayoutEffect, useMemo, useReducer, useRef, useState } from 'preact/hooks';
import { Link } from './parts';

export interface Column<T> {
  head: string;
  cell: (item: T) => ComponentChildren;
  // The key by which the column is sorted; texts are also searched by the filter.
  value?: (item: T) => string | number | undefined;
  wide?: boolean; // long texts
  below?: ComponentChildren; // below the head
  order?: string; // its name in order_by, if the daemon sorts the list by it
  // Not every item has a value; the daemon leaves out the others in this order.
  partial?: boolean;
}

type Sorted = 'ascending' | 'descending' | 'none';

// The head of a column by which the daemon sorts.
export interface OrderLink {
  to: string; // the address of the page in this order
  sorted: Sorted;
}

const features = tableFeatures({
  columnFilteringFeature,
  globalFilteringFeature,
  filteredRowModel: createFilteredRowModel(),
  filterFns: { includesString: filterFn_includesString },
  rowSortingFeature,
  sortedRowModel: createSortedRowModel(),
  sortFns: { alphanumeric: sortFn_alphanumeric, basic: sortFn_basic },
});

// A shorter table is taken in at a glance.
const kLeastFiltered = 10;
// Longer tables have a scroll bar of their own, and only the rows in view.
const kMostWhole = 60;
const kRowHeight = 38; // until a row is measured
const kOverscan = 12; // rows above and below those in view

// Whether the column has texts, which the filter searches.
function isText<T>(column: Column<T>, items: T[]): boolean {
  return items.length > 0 && typeof column.value?.(items[0]) === 'string';
}

function definitionOf<T extends object>(
  column: Column<T>,
  index: number,
  items: T[],
): ColumnDef<typeof features, T> {
  const { value } = column;
  const text = isText(column, items);
  return {
    id: String(index),
    accessorFn: (item: T) => value?.(item),
    enableSorting: value !== undefined,
    sortFn: text ? 'alphanumeric' : 'basic',
    sortUndefined: 'last',
    sortDescFirst: !text,
  };
}

function useVirtualRows(count: number, scroll: RefObject<HTMLDivElement>, enabled: boolean) {
  const [, redraw] = useReducer((times: number) => times + 1, 0);
  const options = {
    count,
    enabled,
    getScrollElement: () => scroll.current,
    estimateSize: () => kRowHeight,
    overscan: kOverscan,
    scrollToFn: elementScroll,
    observeElementRect,
    observeElementOffset,
    onChange: () => redraw(undefined),
  };
  const [virtualizer] = useState(
    () => new Virtualizer<HTMLDivElement, HTMLTableRowElement>(options),
  );
  virtualizer.setOptions(options);
  useLayoutEffect(() => virtualizer._didMount(), [virtualizer]);
  useLayoutEffect(() => virtualizer._willUpdate());
  return virtualizer;
}

// The height of the rows that are not in the page.
function Gap(props: { height: number; columns: number }) {
  if (props.height <= 0) return null;
  return (
    <tr class="gap" aria-hidden="true">
      <td colSpan={props.columns} style={{ height: `${props.height}px` }} />
    </tr>
  );
}

// By how many rows a key moves the focus.
const kMoves: Record<string, number> = {
  ArrowDown: 1,
  ArrowUp: -1,
  PageDown: 10,
  PageUp: -10,
  Home: -Infinity,
  End: Infinity,
};

const kFrames = 20; // until a row that was scrolled to is in the page

function focusRow(scroll: HTMLElement, index: number, frames = kFrames): void {
  const row = scroll.querySelector(`tr[data-index="${index}"]`);
  const target = row?.querySelector<HTMLElement>('a, button');
  if (target) target.focus();
  else if (!row && frames > 0) requestAnimationFrame(() => focusRow(scroll, index, frames - 1));
}

function SortMark(props: { sorted: Sorted }) {
  const marks = { ascending: ' ▲', descending: ' ▼', none: '' };
  return <span aria-hidden="true">{marks[props.sorted]}</span>;
}

export function DataTable<T extends object>(props: {
  caption: string;
  columns: Column<T>[];
  items: T[];
  orders?: (OrderLink | undefined)[]; // of the columns by which the daemon sorts
  // False if the items are a part of a list, of which sorting would mislead.
  whole?: boolean;
}) {
  const { caption, columns, items } = props;
  const whole = props.whole ?? true;
  const scroll = useRef<HTMLDivElement>(null);
  const [filter, setFilter] = useState('');
  const [sorting, setSorting] = useState<SortingState>([]);
  const definitions = useMemo(
    () => columns.map((column, i) => definitionOf(column, i, items)),
    [columns, items],
  );
  const table = useTable({
    features,
    columns: definitions,
    data: items,
    state: { globalFilter: filter, sorting },
    onSortingChange: setSorting,
    globalFilterFn: 'includesString',
    getColumnCanGlobalFilter: (column) => isText(columns[Number(column.id)], items),
    enableMultiSort: false,
  });
  // The order of the daemon replaces that of the page.
  const order = props.orders?.map((link) => link?.to).join(' ');
  useEffect(() => setSorting([]), [order]);
  const rows = table.getRowModel().rows;
  const long = rows.length > kMostWhole;
  const virtualizer = useVirtualRows(rows.length, scroll, long);
  const shown = long ? virtualizer.getVirtualItems() : rows.map((_, index) => ({ index }));
  const size = long ? virtualizer.getTotalSize() : 0;
  const window = long ? virtualizer.getVirtualItems() : [];
  const above = window[0]?.start ?? 0;
  const below = size - (window[window.length - 1]?.end ?? size);
  const searchable = columns.some((column) => isText(column, items));
  const move = (event: JSX.TargetedKeyboardEvent<HTMLDivElement>) => {
    const by = kMoves[event.key];
    const target = event.target as HTMLElement;
    if (by === undefined || target.closest('thead')) return;
    const row = target.closest('tr[data-index]');
    const from = row ? Number(row.getAttribute('data-index')) : -1;
    const to = Math.min(rows.length - 1, Math.max(0, from + by));
    // Rows without a link are scrolled by the browser.
    if (to === from || !scroll.current?.querySelector('tbody a, tbody button')) return;
    event.preventDefault();
    if (long) virtualizer.scrollToIndex(to);
    focusRow(scroll.current, to);
  };
  const headOf = (index: number): { content: ComponentChildren; sorted?: Sorted } => {
    const order = props.orders?.[index];
    if (order) {
      const sorted = sorting.length > 0 ? 'none' : order.sorted;
      return {
        content: (
          <Link to={order.to}>
            {columns[index].head}
            <SortMark sorted={sorted} />
          </Link>
        ),
        sorted,
      };
    }
    const column = table.getColumn(String(index));
    if (!whole || !column?.getCanSort() || items.length < 2) {
      return { content: columns[index].head };
    }
    const now = column.getIsSorted();
    const sorted = now === 'asc' ? 'ascending' : now === 'desc' ? 'descending' : 'none';
    return {
      content: (
        <button type="button" class="sort" onClick={() => column.toggleSorting()}>
          {columns[index].head}
          <SortMark sorted={sorted} />
        </button>
      ),
      sorted,
    };
  };
  return (
    <div class="data-table">
      {searchable && items.length >= kLeastFiltered && (
        <div class="find">
          <input
            type="search"
            value={filter}
            placeholder={whole ? 'Find in this table' : 'Find in these rows'}
            aria-label={`Find in the table: ${caption}`}
            onInput={(event) => setFilter(event.currentTarget.value)}
            // Does not submit a form that has the table.
            onKeyDown={(event) => event.key === 'Enter' && event.preventDefault()}
          />
          <span class="quiet" role="status">
            {filter && `${rows.length} of ${items.length}`}
          </span>
        </div>
      )}
      <div
        ref={scroll}
        class={long ? 'scroll long' : 'scroll'}
        tabIndex={0}
        role="region"
        aria-label={caption}
        onKeyDown={move}
      >
        <table aria-rowcount={long ? rows.length + 1 : undefined}>
          <caption>{caption}</caption>
          <thead>
            <tr>
              {columns.map((column, i) => {
                const { content, sorted } = headOf(i);
                return (
                  <th key={i} scope="col" aria-sort={sorted} class={column.wide ? 'wide-text' : ''}>
                    {content}
                    {column.below}
                  </th>
                );
              })}
            </tr>
          </thead>
          <tbody>
            <Gap height={above} columns={columns.length} />
            {shown.map(({ index }) => {
              const row = rows[index];
              return (
                <tr
                  key={row.id}
                  data-index={index}
                  aria-rowindex={long ? index + 2 : undefined}
                  ref={long ? virtualizer.measureElement : undefined}
                >
                  {columns.map((column, i) =>
                    i === 0 ? (
                      <th key={i} scope="row">
                        {column.cell(row.original)}
                      </th>
                    ) : (
                      <td key={i} class={column.wide ? 'wide-text' : ''}>
                        {column.cell(row.original)}
                      </td>
                    ),
                  )}
                </tr>
              );
            })}
            <Gap height={below} columns={columns.length} />
          </tbody>
        </table>
        {rows.length === 0 && <p class="quiet">No row contains '{filter}'.</p>}
      </div>
    </div>
  );
}
