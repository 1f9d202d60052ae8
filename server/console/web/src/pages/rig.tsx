import { useMemo, useState } from 'preact/hooks';
import { ActionDialog, mayAdminister } from '../action';
import { idOf, remove, rigPath } from '../api';
import type {
  Calibration,
  Caller,
  Instruction,
  ListActivityResponse,
  ListSegmentsResponse,
  ListTablesResponse,
  Rig,
  Segment,
  Table,
  Table_Entry,
} from '../contract';
import { number } from '../format';
import { Histogram } from '../histogram';
import { Given, isReported, useActivity } from '../instruction';
import { EditLabels, Labels } from '../labels';
import { Certainty, knownOf } from '../parameters';
import { Choice, Empty, Loaded, Meter, Problem, SegmentLink, Title } from '../parts';
import { DeviceReports, RigVerdict, WhatChanged, WhatToDo } from './rig_summary';
import { NewestSession } from './session';
import { go, useRead, type Read } from '../state';
import { DataTable, type Column } from '../table';

const kEntries: Column<Table_Entry>[] = [
  {
    head: 'Segment',
    cell: (entry) => <SegmentLink name={entry.segment} />,
    value: (entry) => entry.segment,
  },
  {
    head: 'Entropy [nat]',
    cell: (entry) => number(entry.entropyNats, 4),
    value: (entry) => entry.entropyNats,
  },
  {
    head: 'Gain [nat]',
    cell: (entry) => number(entry.gainNats, 4),
    value: (entry) => entry.gainNats,
  },
];

function Tables(props: { of: Table[] }) {
  return (
    <>
      <h2>Tables</h2>
      <div class="side tables">
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
                The table does not fill: {table.scored} segments were offered. Move the device in
                more directions, and closer to what it sees.
              </p>
            )}
            {table.entries.length === 0 ? (
              <p class="quiet">Empty: no segment has enough information about this group yet.</p>
            ) : (
              <DataTable
                caption={'Segments in the table ' + idOf(table.name)}
                columns={kEntries}
                items={table.entries}
              />
            )}
          </section>
        ))}
      </div>
    </>
  );
}

function EntropyHistogram(props: { segments: Segment[]; group: string }) {
  const of = useMemo(() => {
    const scores = props.segments
      .flatMap((segment) => segment.scores)
      .filter((s) => s.group === props.group && Number.isFinite(s.entropyNats));
    const values = (chosen: typeof scores) => chosen.map((s) => s.entropyNats);
    return [
      { label: 'all', values: values(scores) },
      { label: 'kept in the table', values: values(scores.filter((s) => s.inTable)) },
    ];
  }, [props.segments, props.group]);
  return (
    <Histogram
      label={`Histogram of the entropy of segments for the group ${props.group}`}
      x="entropy [nat]; lower is more informative"
      y="number of segments"
      of={of}
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
                <code>selfcal segment import</code>.
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
              <EntropyHistogram segments={scored} group={group} />
              <p class="quiet">For the newest {scored.length} scored segments.</p>
            </>
          );
        }}
      </Loaded>
    </>
  );
}

// The hub has a copy of a rig that a device reports, and deletes that.
function Delete(props: { rig: string; isReported: boolean; onEnd: () => void }) {
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
      {props.isReported ? (
        <p>
          A device reports this rig: only the copy at this hub is deleted. The event log keeps its
          events, and the reason. If the device still reports, the rig comes back.
        </p>
      ) : (
        <p>
          All its segments, tables, runs and calibrations are deleted. This cannot be undone. The
          event log keeps its events, and the reason.
        </p>
      )}
    </ActionDialog>
  );
}

// What an administrator may change here.
function Administration(props: {
  rig: string;
  of: Rig;
  isReported: boolean;
  onChange: () => void;
}) {
  const [asked, setAsked] = useState<'labels' | 'delete' | null>(null);
  const [given, setGiven] = useState<Instruction | null>(null);
  return (
    <>
      {given && <Given of={given} />}
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
            isReported={props.isReported}
            onGiven={setGiven}
            onEnd={() => {
              setAsked(null);
              props.onChange();
            }}
          />
        )}
        {asked === 'delete' && (
          <Delete rig={props.rig} isReported={props.isReported} onEnd={() => setAsked(null)} />
        )}
      </p>
    </>
  );
}

// Labels, and what an administrator may change.
function Settings(props: {
  rig: string;
  of: Rig;
  activity: Read<ListActivityResponse>;
  caller: Caller | null;
  onChange: () => void;
}) {
  return (
    <section>
      <h2>Labels</h2>
      <Labels of={props.of.labels} />
      {mayAdminister(props.caller, props.of.name) && (
        <Loaded read={props.activity}>
          {(activity) => (
            <Administration
              rig={props.rig}
              of={props.of}
              isReported={isReported(activity)}
              onChange={props.onChange}
            />
          )}
        </Loaded>
      )}
    </section>
  );
}

export function RigPage(props: { rig: string; caller: Caller | null; version: number }) {
  const base = rigPath(props.rig);
  const [changed, setChanged] = useState(0);
  const rig = useRead<Rig>(base, changed);
  const active = useRead<Calibration>(base + '/calibrations/active', props.version);
  const factory = useRead<Calibration>(base + '/calibrations/1');
  const tables = useRead<ListTablesResponse>(base + '/tables', props.version);
  const activity = useActivity(props.rig, props.version);
  const found = activity.value?.rigs[0];
  const known = useMemo(
    () => (active.value && factory.value ? knownOf(active.value, factory.value) : null),
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
  const read = {
    value:
      rig.value && active.value && known
        ? { rig: rig.value, calibration: active.value, known }
        : null,
    error: null,
  };
  return (
    <>
      <Title text={props.rig}>{props.rig}</Title>
      <Loaded read={read}>
        {(value) => (
          <>
            <RigVerdict of={value.calibration} />
            {found?.device && <DeviceReports of={found.device} />}
            <div class="side">
              <WhatChanged rig={props.rig} active={value.calibration} version={props.version} />
              <WhatToDo
                rig={props.rig}
                active={value.calibration}
                activity={found}
                known={value.known}
                version={props.version}
              />
            </div>
            <Certainty rig={value.rig} of={value.known} />
          </>
        )}
      </Loaded>
      <NewestSession rig={props.rig} version={props.version} />
      <Loaded read={tables}>{(value) => <Tables of={value.tables} />}</Loaded>
      {rig.value && (
        <>
          <Entropies
            rig={props.rig}
            groups={rig.value.groups.map((g) => g.group)}
            version={props.version}
          />
          <Settings
            rig={props.rig}
            of={rig.value}
            activity={activity}
            caller={props.caller}
            onChange={() => setChanged(changed + 1)}
          />
        </>
      )}
    </>
  );
}
