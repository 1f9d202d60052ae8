// What an operator reads first about a rig: the verdict on its calibration, what
// has changed, and what to do.
import type { ComponentChildren } from 'preact';
import { useMemo } from 'preact/hooks';
import { idOf, pageOf, rigPath } from '../api';
import type {
  AdviseMotionResponse,
  Calibration,
  CompareCalibrationsResponse,
  CompareCalibrationsResponse_Difference as Difference,
  ListCalibrationsResponse,
  ListEventsResponse,
  ListTablesResponse,
  ReportState,
  RigActivity,
  Table,
} from '../contract';
import { clock, component, estimateText, number, words } from '../format';
import { weakOf, type Known } from '../parameters';
import { Figures, kWeak, Link, Loaded, VerdictBox, When } from '../parts';
import { useRead } from '../state';
import { agreement, largestOf, shownDifference } from '../comparison';

const kEvents = 5;
const kLargest = 3;
const kNotable = 1; // change of a parameter, in sigmas
const kMostWeak = 4; // named in a sentence

// ------------------------------------------------------------- verdict

export function RigVerdict(props: { of: Calibration }) {
  const { of } = props;
  const segments = of.provenance?.segments.length;
  return (
    <VerdictBox of={of}>
      <p>
        <Link to={pageOf(of.name)}>Version {of.version}</Link> is {words(of.state)};{' '}
        {segments === undefined
          ? 'the rig was created with it'
          : `it was computed from ${segments} segments`}{' '}
        <When time={of.createTime} />.
      </p>
    </VerdictBox>
  );
}

// ------------------------------------------------------------- reports

// The last report of a device to its hub, and the program that it runs.
export function DeviceReports(props: { of: ReportState }) {
  const { time, waiting, programVersion } = props.of;
  return (
    <Figures
      of={[
        ['Last report of the device', <When time={time} />],
        ['Records waiting then', waiting],
        ['Program of the device', programVersion],
      ]}
    />
  );
}

// ------------------------------------------------------------- what changed

// The parameters that changed most.
function Largest(props: { of: Difference[] }) {
  const changed = props.of.filter((d) => Math.abs(d.difference) > kNotable * d.sigma);
  if (changed.length === 0) {
    return <p>No parameter changed by more than {kNotable} standard deviation.</p>;
  }
  return (
    <ul>
      {changed.map((d) => {
        const { difference, sigma, unit } = shownDifference(d);
        return (
          <li key={d.component}>
            {component(d.component)}: by {estimateText(difference, sigma, unit)} (
            {number(Math.abs(difference) / sigma, 2)} standard deviations)
          </li>
        );
      })}
    </ul>
  );
}

function Replaced(props: { rig: string; active: string; before: string }) {
  const base = `${rigPath(props.rig)}/calibrations`;
  const other = new URLSearchParams({ b: `rigs/${props.rig}/calibrations/${props.active}` });
  const read = useRead<CompareCalibrationsResponse>(`${base}/${props.before}:compare?${other}`);
  const query = new URLSearchParams({ a: props.before, b: props.active });
  return (
    <Loaded read={read}>
      {(compared) => (
        <>
          <p>
            Version {props.active} replaced version {props.before}. {agreement(compared)}
          </p>
          <Largest of={largestOf(compared, kLargest)} />
          <p>
            <Link to={`${pageOf('rigs/' + props.rig)}/calibrations?${query}#comparison`}>
              Compare all parameters
            </Link>
          </p>
        </>
      )}
    </Loaded>
  );
}

function Events(props: { rig: string; version: number }) {
  const query = new URLSearchParams({ page_size: String(kEvents), order_by: 'number desc' });
  const read = useRead<ListEventsResponse>(`${rigPath(props.rig)}/events?${query}`, props.version);
  return (
    <Loaded read={read}>
      {({ events }) => (
        <>
          <ul class="events" aria-label="Newest events">
            {events.map((event) => (
              <li key={event.number}>
                <time dateTime={event.time} class="quiet">
                  {clock(event.time)}
                </time>{' '}
                {words(event.kind)}
                {event.detail && <span>: {event.detail}</span>}
              </li>
            ))}
          </ul>
          <p>
            <Link to={`/rigs/${props.rig}/events`}>All events</Link>
          </p>
        </>
      )}
    </Loaded>
  );
}

export function WhatChanged(props: { rig: string; active: Calibration; version: number }) {
  const { active } = props;
  const before = active.validation?.activeVersion ?? active.provenance?.baseVersion;
  return (
    <section>
      <h2>What changed</h2>
      {before && before !== '0' ? (
        <Replaced rig={props.rig} active={active.version} before={before} />
      ) : (
        <p>Nothing yet: the factory calibration is in use.</p>
      )}
      <Events rig={props.rig} version={props.version} />
    </section>
  );
}

// ------------------------------------------------------------- what to do

function fullness(tables: Table[]): { entries: number; capacity: number } {
  return {
    entries: tables.reduce((sum, table) => sum + table.entries.length, 0),
    capacity: tables.reduce((sum, table) => sum + table.capacity, 0),
  };
}

function Coaching(props: { rig: string; weak: Known[]; all: number }) {
  // Advice costs the daemon seconds: it is read once for each active version,
  // of which `weak` is a part.
  const read = useRead<AdviseMotionResponse>(`${rigPath(props.rig)}:adviseMotion?max_advice=1`);
  const best = read.value?.advice[0];
  const named = props.weak.slice(0, kMostWeak).map((e) => component(e.component));
  const rest = props.weak.length - named.length;
  return (
    <>
      {best && <strong>{best.instruction} </strong>}
      Of {props.weak.length} of {props.all} parameters little more is known than from the factory (a
      remaining uncertainty above {100 * kWeak} %): {named.join('; ')}
      {rest > 0 && ` and ${rest} more`}. <Link to={`/rigs/${props.rig}/coach`}>The coach</Link>{' '}
      recommends the motion with the largest gain.
    </>
  );
}

interface Facts {
  rig: string;
  active: Calibration;
  newest: Calibration | undefined;
  activity: RigActivity | undefined;
  tables: Table[];
  known: Known[];
}

// What is to be done, the most urgent first.
function actionsOf(facts: Facts): ComponentChildren[] {
  const { rig, active, newest, activity, tables, known } = facts;
  const actions: ComponentChildren[] = (activity?.alarms ?? []).map((alarm) => (
    <strong class="alarm">{alarm}</strong>
  ));
  if (activity?.run) {
    actions.push(
      <>
        A recalibration is computing:{' '}
        <Link to={pageOf(activity.run.name)}>follow its progress</Link>.
      </>,
    );
  }
  if (newest && newest.version !== active.version && newest.state === 'REJECTED') {
    actions.push(
      <>
        <Link to={pageOf(newest.name)}>Version {newest.version}</Link> was rejected:{' '}
        {newest.reasons.join(' ')} Version {active.version} remains active.
      </>,
    );
  }
  const { entries, capacity } = fullness(tables);
  if (activity && !activity.lastSeen) {
    actions.push(
      <>
        Send segments with the client library or <code>selfcal segment import {rig} DIR</code>: none
        has arrived yet.
      </>,
    );
  } else if (entries < capacity) {
    const starved = tables.filter((table) => table.starved).map((table) => idOf(table.name));
    actions.push(
      starved.length > 0
        ? `Move the device in more directions, and closer to what it sees: the tables ${starved.join(', ')} do not fill.`
        : `Keep the device moving: the tables hold ${entries} of ${capacity} segments; the next run starts when they are full.`,
    );
  }
  const weak = weakOf(known);
  if (weak.length > 0 && activity?.lastSeen) {
    actions.push(<Coaching key={active.version} rig={rig} weak={weak} all={known.length} />);
  }
  return actions;
}

export function WhatToDo(props: {
  rig: string;
  active: Calibration;
  activity: RigActivity | undefined;
  known: Known[];
  version: number;
}) {
  const base = rigPath(props.rig);
  const tables = useRead<ListTablesResponse>(base + '/tables', props.version);
  const newest = useRead<ListCalibrationsResponse>(
    base + '/calibrations?page_size=1',
    props.version,
  );
  const actions = useMemo(
    () =>
      actionsOf({
        rig: props.rig,
        active: props.active,
        newest: newest.value?.calibrations[0],
        activity: props.activity,
        tables: tables.value?.tables ?? [],
        known: props.known,
      }),
    [props.rig, props.active, props.known, newest.value, props.activity, tables.value],
  );
  return (
    <section>
      <h2>What to do</h2>
      {actions.length === 0 ? (
        <p>Nothing: selfcal keeps the calibration true as segments arrive.</p>
      ) : (
        <ol class="actions">
          {actions.map((action, i) => (
            <li key={i}>{action}</li>
          ))}
        </ol>
      )}
    </section>
  );
}
