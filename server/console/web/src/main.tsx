// Routes an address to its page. The address of a page is the name of its
// resource: rigs/a/segments/s~0 in gRPC is /rigs/a/segments/s~0 here.
import './style.css';
import { render } from 'preact';
import { useEffect } from 'preact/hooks';
import type { Caller } from './contract';
import { kRigFilter } from './fleet';
import { ShortcutHelp } from './shortcuts';
import { Empty, Link, Problem, Title } from './parts';
import { useAddress, useLive, useRead } from './state';
import { Calibrations } from './pages/calibrations';
import { CoachPage } from './pages/coach';
import { Cohorts } from './pages/cohorts';
import { Events } from './pages/events';
import { FleetParameters } from './pages/fleet_parameters';
import { FleetVersions } from './pages/fleet_versions';
import { Instructions } from './pages/instructions';
import { RigPage } from './pages/rig';
import { Rigs } from './pages/rigs';
import { RunPage } from './pages/run';
import { Runs } from './pages/runs';
import { SegmentPage } from './pages/segment';
import { FleetSegments, Segments } from './pages/segments';
import { SessionPage, Sessions } from './pages/session';

const kRigPages: [string, string][] = [
  ['', 'Overview'],
  ['sessions', 'Sessions'],
  ['coach', 'Coach'],
  ['segments', 'Segments'],
  ['calibrations', 'Calibrations'],
  ['recalibrations', 'Runs'],
  ['events', 'Events'],
  ['instructions', 'Instructions'],
];

function RigNav(props: { rig: string; page: string }) {
  return (
    <nav class="tabs" aria-label={'Pages of rig ' + props.rig}>
      {kRigPages.map(([page, name]) => (
        <Link
          key={page}
          to={`/rigs/${props.rig}${page && '/' + page}`}
          current={page === props.page}
        >
          {name}
        </Link>
      ))}
    </nav>
  );
}

// The pages about all rigs that the overview leads to.
const kFleetPages: [string, string][] = [
  ['', 'Overview'],
  ['segments', 'Segments'],
  ['calibrations', 'Calibrations'],
  ['recalibrations', 'Runs'],
];

// The rigs that are chosen on one of these pages stay so on the others.
function FleetNav(props: { page: string }) {
  const address = useAddress().searchParams;
  const parameterOf = (page: string) => (page ? kRigFilter : 'filter');
  const filter = address.get(parameterOf(props.page));
  const query = (page: string) =>
    filter ? '?' + new URLSearchParams({ [parameterOf(page)]: filter }).toString() : '';
  return (
    <nav class="tabs" aria-label="Pages of all rigs">
      {kFleetPages.map(([page, name]) => (
        <Link key={page} to={'/' + page + query(page)} current={page === props.page}>
          {name}
        </Link>
      ))}
    </nav>
  );
}

function FleetPage(props: { page: string; caller: Caller | null; version: number }) {
  const { page, version } = props;
  if (page === 'segments') return <FleetSegments version={version} />;
  if (page === 'calibrations') return <FleetVersions version={version} />;
  if (page === 'recalibrations') return <Runs rig="" version={version} />;
  return <Rigs caller={props.caller} version={version} />;
}

const isFleetPage = (parts: string[]) =>
  parts.length < 2 && kFleetPages.some(([page]) => page === (parts[0] ?? ''));

function Page(props: { parts: string[]; caller: Caller | null; version: number }) {
  const [top, rig, page, id] = props.parts;
  const { version, caller } = props;
  if (isFleetPage(props.parts)) {
    return (
      <>
        <FleetNav page={top ?? ''} />
        <FleetPage page={top ?? ''} caller={caller} version={version} />
      </>
    );
  }
  if (top === 'events' && !rig) return <Events rig="" version={version} />;
  if (top === 'parameters' && !rig) return <FleetParameters version={version} />;
  if (top === 'cohorts' && !rig) return <Cohorts version={version} />;
  if (top === 'rigs' && rig) {
    const shown = () => {
      if (!page) return <RigPage rig={rig} caller={caller} version={version} />;
      if (page === 'coach') return <CoachPage rig={rig} version={version} />;
      if (page === 'events') return <Events rig={rig} version={version} />;
      if (page === 'instructions') return <Instructions rig={rig} version={version} />;
      if (page === 'calibrations' && !id) {
        return <Calibrations rig={rig} caller={caller} version={version} />;
      }
      if (page === 'recalibrations') {
        return id ? (
          <RunPage key={id} rig={rig} run={id} version={version} />
        ) : (
          <Runs rig={rig} version={version} />
        );
      }
      if (page === 'sessions') {
        return id ? (
          <SessionPage key={id} rig={rig} session={id} version={version} />
        ) : (
          <Sessions rig={rig} version={version} />
        );
      }
      if (page === 'segments') {
        return id ? (
          <SegmentPage key={id} rig={rig} caller={caller} segment={id} version={version} />
        ) : (
          <Segments rig={rig} version={version} />
        );
      }
      return null;
    };
    const content = shown();
    if (content) {
      return (
        <>
          <RigNav rig={rig} page={page ?? ''} />
          {content}
        </>
      );
    }
  }
  return (
    <>
      <Title text="Not found">There is no such page</Title>
      <Empty>
        The console has no page at this address. Start at the <Link to="/">list of rigs</Link>.
      </Empty>
    </>
  );
}

function App() {
  const url = useAddress();
  // A calibration is shown on the page of the rig's calibrations.
  const calibration = /^(\/rigs\/[^/]+\/calibrations)\/(\d+)$/.exec(url.pathname);
  const parts = (calibration ? calibration[1] : url.pathname)
    .split('/')
    .filter(Boolean)
    .map(decodeURIComponent);
  const rig = parts[0] === 'rigs' ? (parts[1] ?? '') : '';
  const caller = useRead<Caller>('caller');
  const { version, live } = useLive(rig);
  useEffect(() => window.scrollTo(0, 0), [url.pathname]);
  return (
    <>
      <a class="skip" href="#content">
        Skip to the content
      </a>
      <header>
        <Link to="/" class="brand">
          selfcal
        </Link>
        <nav aria-label="Main">
          <Link to="/" current={isFleetPage(parts) || rig !== ''}>
            Rigs
          </Link>
          <Link to="/parameters" current={parts[0] === 'parameters'}>
            Parameters
          </Link>
          <Link to="/cohorts" current={parts[0] === 'cohorts'}>
            Cohorts
          </Link>
          <Link to="/events" current={parts[0] === 'events'}>
            Events
          </Link>
        </nav>
        <span class={live ? 'live on' : 'live'} role="status">
          {live ? 'live' : 'not live'}
        </span>
      </header>
      <main id="content">
        {caller.error ? (
          <Problem error={caller.error} />
        ) : (
          <Page parts={parts} caller={caller.value} version={version} />
        )}
      </main>
      <footer class="quiet">
        {caller.value && `selfcald ${caller.value.programVersion}, as ${caller.value.name}. `}
        <ShortcutHelp />
      </footer>
    </>
  );
}

render(<App />, document.getElementById('app')!);
