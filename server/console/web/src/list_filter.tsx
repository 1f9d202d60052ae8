// The filter of a list: a field for conditions, and menus for those that are
// chosen most often. The address has both.
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { ApiError } from './api';
import { RigChoice, kRigFilter } from './fleet';
import { words } from './format';
import { Choice, Link } from './parts';
import { go, useAddress, withQuery } from './state';

// A menu for the condition NAME = VALUE.
export interface Menu {
  name: string; // also that of the query parameter of the address
  label: string;
  of: string[];
}

// The values of an enumeration of the contract that an item can have.
export function valuesOf(enumeration: Record<string, string>): string[] {
  return Object.values(enumeration).filter((value) => !value.endsWith('_UNSPECIFIED'));
}

// The fields of the filter of a list.
export interface FilterSyntax {
  items: string; // segments
  equal: [name: string, values?: string][]; // fields with =
  compared: [name: string, unit?: string][]; // fields with <, <=, =, >= and >
  note?: string; // below the fields
  examples: string[];
}

// The conditions of the field and of the menus, joined by AND.
export function filterOf(address: URLSearchParams, menus: Menu[]): string {
  const chosen = menus.flatMap(({ name }) => {
    const value = address.get(name);
    return value ? [`${name} = ${value}`] : [];
  });
  return [(address.get('filter') ?? '').trim(), ...chosen].filter(Boolean).join(' AND ');
}

// True if the address chooses some of the items, or another order.
export function isNarrowed(address: URLSearchParams, menus: Menu[]): boolean {
  return filterOf(address, menus) !== '' || address.has('order_by');
}

// Stands in place of a list that a filter has left empty.
export function NoMatch(props: { item: string; menus: Menu[] }) {
  const none = Object.fromEntries(props.menus.map(({ name }) => [name, '']));
  return (
    <p>
      No {props.item} matches.{' '}
      <Link to={withQuery({ ...none, filter: '', order_by: '', page_token: '' })}>
        Show all, newest first
      </Link>
    </p>
  );
}

function Names(props: { of: [name: string, note?: string][] }) {
  return (
    <>
      {props.of.map(([name, note], i) => (
        <>
          {i > 0 && ', '}
          <code>{name}</code>
          {note && ` (${note})`}
        </>
      ))}
    </>
  );
}

function Help(props: { of: FilterSyntax }) {
  const { items, equal, compared, note, examples } = props.of;
  return (
    <details>
      <summary>Filter syntax</summary>
      <p>Conditions joined by AND; the {items} that meet all of them are listed.</p>
      <ul>
        <li>
          With <code>=</code>: <Names of={equal} />.
        </li>
        <li>
          With <code>=</code> <code>&lt;</code> <code>&lt;=</code> <code>&gt;</code>{' '}
          <code>&gt;=</code>: <Names of={compared} />.{note && ' ' + note}
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

function FilterForm(props: {
  mistake: ApiError | null;
  syntax: FilterSyntax;
  menus: Menu[];
  children?: ComponentChildren;
}) {
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
  return (
    <form role="search" onSubmit={submit}>
      <div class="bar">
        <label class="wide">
          Filter
          <input
            type="search"
            value={draft}
            placeholder={'all ' + props.syntax.items}
            spellcheck={false}
            aria-invalid={props.mistake !== null}
            aria-describedby="filter-mistake"
            onInput={edit}
          />
        </label>
        <button type="submit">Show</button>
        {props.menus.map(({ name, label, of }) => (
          <Choice
            key={name}
            label={label}
            value={address.get(name) ?? ''}
            of={[['', 'any'], ...of.map((value): [string, string] => [value, words(value)])]}
            onChoice={(value) => go(withQuery({ [name]: value, page_token: '' }))}
          />
        ))}
        {props.children}
      </div>
      <p id="filter-mistake" class="mistake" role="alert">
        {props.mistake?.message}
      </p>
      <Help of={props.syntax} />
    </form>
  );
}

// `mistake` is shown beside the field that it is about. The children are further
// controls.
export function ListFilter(props: {
  mistake: ApiError | null;
  acrossRigs: boolean;
  syntax: FilterSyntax;
  menus: Menu[];
  children?: ComponentChildren;
}) {
  const { mistake, acrossRigs, ...form } = props;
  const isOfRigs = mistake?.message.startsWith(kRigFilter) ?? false;
  return (
    <>
      {acrossRigs && <RigChoice mistake={isOfRigs ? mistake : null} />}
      <FilterForm {...form} mistake={isOfRigs ? null : mistake} />
    </>
  );
}
