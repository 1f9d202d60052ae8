// Parts of the pages that show many rigs.
import type { JSX } from 'preact';
import { idOf, type ApiError } from './api';
import { NameLink, Problem } from './parts';
import { go, useAddress, withQuery } from './state';
import type { Column } from './table';

// Names the rig of an item. `rig` returns rigs/{rig}, or '' for an item of the
// daemon itself.
export function rigColumn<T>(rig: (item: T) => string): Column<T> {
  return {
    head: 'Rig',
    cell: (item) =>
      rig(item) ? <NameLink name={rig(item)}>{idOf(rig(item))}</NameLink> : 'the daemon',
    value: (item) => idOf(rig(item)),
  };
}

// The field for a filter of rigs, which the query parameter of the address has.
export function RigFilter(props: { label: string; parameter: string }) {
  const { label, parameter } = props;
  const search = (event: JSX.TargetedInputEvent<HTMLInputElement>) =>
    go(withQuery({ [parameter]: event.currentTarget.value, page_token: '' }), true);
  return (
    <label>
      {label}
      <input
        type="search"
        value={useAddress().searchParams.get(parameter) ?? ''}
        placeholder="a part of the name, or labels.site = lab"
        size={40}
        onInput={search}
      />
    </label>
  );
}

// The query parameter of lists across rigs that chooses the rigs.
export const kRigFilter = 'rig_filter';

// The field above such a list.
export function RigChoice(props: { mistake: ApiError | null }) {
  return (
    <form class="bar" role="search" onSubmit={(event) => event.preventDefault()}>
      <RigFilter label="Rigs" parameter={kRigFilter} />
      {props.mistake && <Problem error={props.mistake} />}
    </form>
  );
}
