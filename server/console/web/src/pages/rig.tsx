import { useMemo, useState } from 'preact/hooks';
import uPlot from 'uplot';
import { ActionDialog, mayAdminister } from '../action';
import { idOf, pageOf, remove, rigPath } from '../api';
import type {
  Calibration,
  Caller,
  ComponentEstimate,
  ListSegmentsResponse,
  ListTablesResponse,
  Rig,
  Segment,
  Table,
} from '../contract';
import { component, matches, number, quantity } from '../format';
import { EditLabels, Labels } from '../labels';
import {
  Badge,
  Choice,
  DataTable,
  Empty,
  Figures,
  Link,
  Loaded,
  Meter,
  Problem,
  SegmentLink,
  Title,
  Unknown,
  When,
  kWeak,
  kWell,
} from '../parts';
import { kColours, Plot } from '../plot';
import { NewestSession } from './session';
import { go, useRead } from '../state';

interface Known extends ComponentEstimate {
  tolerance: number;
  ratio: number; // sigma as a fraction of the factory tolerance
}

function known(active: Calibration, factory: Calibration): Known[] {
  const tolerances = new Map(factory.estimates.map((e) => [e.component, e.sigma]));
  return active.estimates
    .map((estimate) => {
      const tolerance = tolerances.get(estimate.component) ?? 0;
      return { ...estimate, tolerance, ratio: estimate.sigma / tolerance };
    })
    .filter((estimate) => estimate.tolerance > 0);
}

function verdict(ratio: number): string {
  if (ratio <= kWell) return 'well known';
  return ratio <= kWeak ? 'better than the factory' : 'hardly better than the factory';
}

function Group(props: { name: string; of: Known[] }) {
  const mean = Math.exp(props.of.reduce((sum, e) => sum + Math.log(e.ratio), 0) / props.of.length);
  return (
    <section>
      <h3>
        {props.name}: {verdict(mean)}
      </h3>
      <DataTable
        caption={'Uncertainty of the group ' + props.name}
        head={['Parameter', 'Value', 'Sigma', 'Factory tolerance', 'Still unknown']}
        rows={props.of.map((e) => [
          component(e.component),
          quantity(e.value, e.unit),
          number(e.sigma),
          number(e.tolerance),
          <Unknown ratio={e.ratio} of={component(e.component)} />,
        ])}
      />
    </section>
  );
}

function Weak(props: { of: Known[] }) {
  const weak = props.of.filter((e) => e.ratio > kWeak).sort((a, b) => b.ratio - a.ratio);
  if (weak.length === 0) {
    return <p>Every parameter is known at least twice as well as from the factory.</p>;
  }
  return (
    <>
      <p>
        {weak.length} of {props.of.length} parameters are hardly better known than from the factory.
        The recordings so far do not determine:
      </p>
      <ul>
        {weak.slice(0, 8).map((e) => (
          <li key={e.component}>
            {component(e.component)} <span class="quiet">({e.component})</span>
          </li>
        ))}
        {weak.length > 8 && <li>and {weak.length - 8} more, in the tables below</li>}
      </ul>
    </>
  );
}

function Knowledge(props: { rig: Rig; of: Known[] }) {
  return (
    <>
      <h2>Weak parameters</h2>
      <Weak of={props.of} />
      <p>
        <Link to={pageOf(props.rig.name) + '/coach'}>The coach</Link> recommends the motion with the
        largest gain.
      </p>
      <h2>Uncertainty by group</h2>
      {props.rig.groups.map((group) => {
        const members = props.of.filter((e) =>
          group.patterns.some((pattern) => matches(pattern, e.component)),
        );
        return members.length === 0 ? null : (
          <Group key={group.group} name={group.group} of={members} />
        );
      })}
    </>
  );
}

function Tables(props: { of: Table[] }) {
  return (
    <>
      <h2>Tables</h2>
      {props.of.map((table) => (
        <section key={table.name}>
          <h3>
            {idOf(table.name)}{' '}
            <Meter
              value={table.entries.length}
              of={table.capacity}
              label={'fill of the table ' + idOf(table.name)}
            />
          </h3>
          {table.starved && (
            <p class="warning">
              The table does not fill: {table.scored} segments were offered. Move the device in more
              directions, and closer to what it sees.
            </p>
          )}
          {table.entries.length === 0 ? (
            <p class="quiet">Empty: no segment has enough information about this group yet.</p>
          ) : (
            <DataTable
              caption={'Segments in the table ' + idOf(table.name)}
              head={['Segment', 'Entropy [nats]', 'Gain [nats]']}
              rows={table.entries.map((entry) => [
                <SegmentLink name={entry.segment} />,
                number(entry.entropyNats, 4),
                number(entry.gainNats, 4),
              ])}
            />
          )}
        </section>
      ))}
    </>
  );
}

const kBins = 24;

function Histogram(props: { segments: Segment[]; group: string }) {
  const { data, low, high } = useMemo(() => {
    const scores = props.segments
      .flatMap((segment) => segment.scores)
      .filter((s) => s.group === props.group && Number.isFinite(s.entropyNats));
    const all = scores.map((s) => s.entropyNats);
    const low = Math.min(...all);
    const width = (Math.max(...all) - low || 1) / kBins;
    const count = (wanted: boolean) => {
      const bins = new Array<number>(kBins).fill(0);
      for (const s of scores) {
        if (wanted && !s.inTable) continue;
        bins[Math.min(kBins - 1, Math.floor((s.entropyNats - low) / width))]++;
      }
      return bins;
    };
    const centres = Array.from({ length: kBins }, (_, i) => low + (i + 0.5) * width);
    return {
      data: [centres, count(false), count(true)] as uPlot.AlignedData,
      low,
      high: low + kBins * width,
    };
  }, [props.segments, props.group]);
  const bars = uPlot.paths.bars!({ size: [0.9, 60] });
  return (
    <Plot
      label={`Histogram of the entropy of segments for the group ${props.group}`}
      data={data}
      x={{ label: 'entropy [nats], lower is more informative', range: [low, high] }}
      y="segments"
      series={[
        {
          label: 'all',
          fill: kColours[0] + '66',
          stroke: kColours[0],
          paths: bars,
          points: { show: false },
        },
        {
          label: 'kept in the table',
          fill: kColours[1],
          stroke: kColours[1],
          paths: bars,
          points: { show: false },
        },
      ]}
    />
  );
}

function Entropies(props: { rig: string; groups: string[]; version: number }) {
  const [group, setGroup] = useState(props.groups[0]);
  const read = useRead<ListSegmentsResponse>(
    rigPath(props.rig) + '/segments?page_size=200&view=BASIC',
    props.version,
  );
  return (
    <>
      <h2>Entropy of segments</h2>
      <Loaded read={read}>
        {({ segments }) => {
          const scored = segments.filter((s) => s.scores.length > 0);
          if (scored.length === 0) {
            return (
              <Empty>
                No segment is scored yet. Send some with the client library or{' '}
                <code>selfcal import</code>.
              </Empty>
            );
          }
          return (
            <>
              <div class="bar">
                <Choice
                  label="Group"
                  value={group}
                  of={props.groups.map((name) => [name, name])}
                  onChoice={setGroup}
                />
              </div>
              <Histogram segments={scored} group={group} />
              <p class="quiet">For the newest {scored.length} scored segments.</p>
            </>
          );
        }}
      </Loaded>
    </>
  );
}

function Delete(props: { rig: string; onEnd: () => void }) {
  return (
    <ActionDialog
      title={`Delete the rig ${props.rig}?`}
      button="Delete"
      act={async (reason) => {
        await remove(rigPath(props.rig), reason);
        go('/');
      }}
      onEnd={props.onEnd}
    >
      <p>
        All its segments, tables, runs and calibrations are deleted. This cannot be undone. The
        event log keeps its events, and the reason.
      </p>
    </ActionDialog>
  );
}

// What an administrator may change here.
function Administration(props: { rig: string; of: Rig; onChange: () => void }) {
  const [asked, setAsked] = useState<'labels' | 'delete' | null>(null);
  return (
    <p class="buttons">
      <button type="button" onClick={() => setAsked('labels')}>
        Edit labels
      </button>
      <button type="button" onClick={() => setAsked('delete')}>
        Delete rig
      </button>
      {asked === 'labels' && (
        <EditLabels
          rig={props.rig}
          of={props.of}
          onEnd={() => {
            setAsked(null);
            props.onChange();
          }}
        />
      )}
      {asked === 'delete' && <Delete rig={props.rig} onEnd={() => setAsked(null)} />}
    </p>
  );
}

export function RigPage(props: { rig: string; caller: Caller | null; version: number }) {
  const base = rigPath(props.rig);
  const [changed, setChanged] = useState(0);
  const rig = useRead<Rig>(base, changed);
  const active = useRead<Calibration>(base + '/calibrations/active', props.version);
  const factory = useRead<Calibration>(base + '/calibrations/1');
  const tables = useRead<ListTablesResponse>(base + '/tables', props.version);
  const both = useMemo(
    () => (active.value && factory.value ? known(active.value, factory.value) : null),
    [active.value, factory.value],
  );
  // An error is shown once, not for each part of the page.
  const problem = rig.error ?? active.error ?? factory.error ?? tables.error;
  if (problem) {
    return (
      <>
        <Title text={props.rig}>{props.rig}</Title>
        <Problem error={problem} />
      </>
    );
  }
  return (
    <>
      <Title text={props.rig}>{props.rig}</Title>
      <Loaded read={active}>
        {(calibration) => (
          <Figures
            of={[
              ['Active version', <Link to={pageOf(calibration.name)}>{calibration.version}</Link>],
              ['State', <Badge state={calibration.state} />],
              ['Created', <When time={calibration.createTime} />],
              [
                'From',
                calibration.provenance
                  ? `${calibration.provenance.segments.length} segments`
                  : 'the factory',
              ],
            ]}
          />
        )}
      </Loaded>
      {rig.value && (
        <>
          <h2>Labels</h2>
          <Labels of={rig.value.labels} />
          {mayAdminister(props.caller, rig.value.name) && (
            <Administration
              rig={props.rig}
              of={rig.value}
              onChange={() => setChanged(changed + 1)}
            />
          )}
        </>
      )}
      <Loaded read={{ value: rig.value && both && { rig: rig.value, both }, error: null }}>
        {(value) => <Knowledge rig={value.rig} of={value.both} />}
      </Loaded>
      <NewestSession rig={props.rig} version={props.version} />
      <Loaded read={tables}>{(value) => <Tables of={value.tables} />}</Loaded>
      {rig.value && (
        <Entropies
          rig={props.rig}
          groups={rig.value.groups.map((g) => g.group)}
          version={props.version}
        />
      )}
    </>
  );
}
