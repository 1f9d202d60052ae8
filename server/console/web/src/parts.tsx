// Components that several pages share.
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { idOf, pageOf, type ApiError } from './api';
import type { Calibration, SolverReport } from './contract';
import { ago, clock, number } from './format';
import { go } from './state';

export function Link(props: {
  to: string;
  children: ComponentChildren;
  current?: boolean;
  class?: string;
  title?: string;
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
      title={props.title}
      aria-current={props.current ? 'page' : undefined}
    >
      {props.children}
    </a>
  );
}

// The heading of a page; it gets the focus when the page changes.
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

// Shows an error, a loading note, or the value that was read.
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
  GOOD: 'good',
  NOT_TRUSTWORTHY: 'bad',
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

const kVerdictTones: Record<string, string> = {
  GOOD: 'good',
  WEAK: 'weak',
  NOT_TRUSTWORTHY: 'bad',
};

// The verdict on a version, with its reasons.
export function VerdictBox(props: { of: Calibration; children?: ComponentChildren }) {
  const { kind, text, sentences } = props.of.verdict ?? {
    kind: 'UNKNOWN',
    text: 'unknown',
    sentences: [],
  };
  return (
    <section class={'box verdict ' + (kVerdictTones[kind] ?? '')}>
      <h2>Verdict: {text}</h2>
      {props.children}
      {sentences.length > 0 && (
        <ul>
          {sentences.map((sentence) => (
            <li key={sentence}>{sentence}</li>
          ))}
        </ul>
      )}
    </section>
  );
}

// A meter that also shows the value and the total as numbers.
export function Meter(props: { value: number; of: number; label: string }) {
  return (
    <span class="meter">
      <meter min={0} max={props.of} value={props.value} aria-label={props.label} />
      {props.value} / {props.of}
    </span>
  );
}

// Limits of sigma as a fraction of the factory tolerance.
export const kWell = 0.1;
export const kWeak = 0.5;

// Shows a sigma as a fraction of the factory tolerance.
export function Remaining(props: { ratio: number; of: string }) {
  return (
    <span class="meter">
      <meter
        min={0}
        max={1}
        low={kWell}
        high={kWeak}
        optimum={0}
        value={Math.min(props.ratio, 1)}
        aria-label={'fraction of the tolerance of ' + props.of}
      />
      {number(100 * props.ratio, 2)} %
    </span>
  );
}

export type Figure = [string, ComponentChildren];

// A list of names and values; null entries are not shown.
export function Figures(props: { of: (Figure | null)[] }) {
  return (
    <dl class="figures">
      {props.of
        .filter((figure) => figure !== null)
        .map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
    </dl>
  );
}

// Figures about a solver run, for several pages.
export function solverFigures(
  solver: SolverReport,
): Record<'iterations' | 'reprojection' | 'rank', Figure> {
  return {
    iterations: ['Iterations', solver.iterations],
    reprojection: [
      'Reprojection error (root mean square)',
      `${number(solver.reprojectionRmsBeforePx)} to ${number(solver.reprojectionRmsAfterPx)} px`,
    ],
    rank: ['Observable directions', `${solver.rank} of ${solver.components}`],
  };
}

// Long names are shortened in the middle, where there is no room for them: their
// ends are what distinguishes segments.
const kLong = 24;
const kEnd = 10;

// The link of a rig, session or segment, by the name of the resource.
export function NameLink(props: { name: string; children: string }) {
  const { name, children: text } = props;
  const cut = text.length - kEnd;
  return (
    <Link to={pageOf(name)} class="name" title={text.length > kLong ? text : undefined}>
      {text.length > kLong ? (
        <>
          <span class="start">{text.slice(0, cut)}</span>
          <span>{text.slice(cut)}</span>
        </>
      ) : (
        text
      )}
    </Link>
  );
}

export function SegmentLink(props: { name: string }) {
  return <NameLink name={props.name}>{decodeURIComponent(idOf(props.name))}</NameLink>;
}

export function SegmentLinks(props: { names: string[] }) {
  return (
    <ul class="columns">
      {props.names.map((name) => (
        <li key={name}>
          <SegmentLink name={name} />
        </li>
      ))}
    </ul>
  );
}

// A menu to choose one of several values; each has a label.
export function Choice(props: {
  label: string;
  value: string;
  of: [string, string][];
  onChoice: (value: string) => void;
}) {
  return (
    <label>
      {props.label}
      <select value={props.value} onChange={(event) => props.onChoice(event.currentTarget.value)}>
        {props.of.map(([value, name]) => (
          <option key={value} value={value}>
            {name}
          </option>
        ))}
      </select>
    </label>
  );
}
