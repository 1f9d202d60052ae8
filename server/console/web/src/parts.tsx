// What several pages are made of.
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import type { ApiError } from './api';
import { ago, clock } from './format';
import { go } from './state';

export function Link(props: {
  to: string;
  children: ComponentChildren;
  current?: boolean;
  class?: string;
}) {
  const open = (event: JSX.TargetedMouseEvent<HTMLAnchorElement>) => {
    if (event.metaKey || event.ctrlKey || event.shiftKey || event.button) return;
    event.preventDefault();
    go(props.to);
  };
  return (
    <a
      href={props.to}
      onClick={open}
      class={props.class}
      aria-current={props.current ? 'page' : undefined}
    >
      {props.children}
    </a>
  );
}

// The heading of a page, which a change of the page moves the focus to.
export function Title(props: { children: ComponentChildren; text: string }) {
  const heading = useRef<HTMLHeadingElement>(null);
  useEffect(() => {
    document.title = props.text + ' - selfcal';
    heading.current?.focus();
  }, [props.text]);
  return (
    <h1 ref={heading} tabIndex={-1}>
      {props.children}
    </h1>
  );
}

export function Problem(props: { error: ApiError }) {
  return (
    <div class="box problem" role="alert">
      <p>
        <strong>{props.error.message}</strong>
      </p>
      <p>{props.error.whatToDo}</p>
      <p class="quiet">{props.error.code}</p>
    </div>
  );
}

export function Empty(props: { children: ComponentChildren }) {
  return <div class="box empty">{props.children}</div>;
}

// An error, a wait, or what was read.
export function Loaded<T>(props: {
  read: { value: T | null; error: ApiError | null };
  children: (value: T) => ComponentChildren;
}) {
  if (props.read.error) return <Problem error={props.read.error} />;
  if (props.read.value === null) {
    return (
      <p class="quiet" role="status">
        Loading ...
      </p>
    );
  }
  return <>{props.children(props.read.value)}</>;
}

export function When(props: { time?: string }) {
  return (
    <time dateTime={props.time} title={clock(props.time)}>
      {ago(props.time)}
    </time>
  );
}

const kTones: Record<string, string> = {
  ACTIVE: 'good',
  SUCCEEDED: 'good',
  ACCEPTED: 'good',
  SCORED: 'good',
  REJECTED: 'bad',
  FAILED: 'bad',
  UNUSABLE: 'bad',
  RUNNING: 'busy',
  PENDING: 'busy',
  CANDIDATE: 'busy',
};

export function Badge(props: { state: string }) {
  return (
    <span class={'badge ' + (kTones[props.state] ?? '')}>
      {props.state.toLowerCase().replaceAll('_', ' ')}
    </span>
  );
}

// A part of a whole, with both in words.
export function Meter(props: { value: number; of: number; label: string }) {
  return (
    <span class="meter">
      <meter min={0} max={props.of} value={props.value} aria-label={props.label} />
      {props.value} / {props.of}
    </span>
  );
}

export function Figures(props: { of: [string, ComponentChildren][] }) {
  return (
    <dl class="figures">
      {props.of.map(([name, value]) => (
        <div key={name}>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}

export function DataTable(props: {
  caption: string;
  head: ComponentChildren[];
  rows: ComponentChildren[][];
  hideCaption?: boolean;
}) {
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={props.caption}>
      <table>
        <caption class={props.hideCaption ? 'hidden' : ''}>{props.caption}</caption>
        <thead>
          <tr>
            {props.head.map((cell) => (
              <th scope="col">{cell}</th>
            ))}
          </tr>
        </thead>
        <tbody>
          {props.rows.map((row) => (
            <tr>
              {row.map((cell, column) =>
                column === 0 ? <th scope="row">{cell}</th> : <td>{cell}</td>,
              )}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

// To the next page and to the first one; the address says where one is.
export function Pager(props: { next: string; first: string | null; more: string | null }) {
  if (props.first === null && props.more === null) return null;
  return (
    <nav class="pager" aria-label="Pages">
      {props.first !== null && <Link to={props.first}>First page</Link>}
      {props.more !== null && <Link to={props.more}>{props.next}</Link>}
    </nav>
  );
}
