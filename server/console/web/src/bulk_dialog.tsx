// The dialog of a change of many rigs: which rigs, the progress, and what failed.
import { useEffect, useState } from 'preact/hooks';
import { ActionForm, Dialog } from './action';
import { Failure, idOf, pageOf, type ApiError } from './api';
import {
  makeChanges,
  readPlan,
  type BulkAction,
  type Plan,
  type Remark,
  type RigChange,
  type Statement,
} from './bulk';
import { Link, Loaded, Meter } from './parts';
import { DataTable, type Column } from './table';

const countOf = (rigs: number) => (rigs === 1 ? '1 rig' : `${rigs} rigs`);

const kChanges: Column<RigChange>[] = [
  { head: 'Rig', cell: (change) => idOf(change.rig), value: (change) => idOf(change.rig) },
  { head: 'Change', cell: (change) => change.effect, value: (change) => change.effect },
  { head: 'By', cell: (change) => (change.isReported ? 'its device' : 'this daemon') },
];

const kRemarks: Column<Remark>[] = [
  {
    head: 'Rig',
    cell: (remark) => <Link to={pageOf(remark.rig)}>{idOf(remark.rig)}</Link>,
    value: (remark) => idOf(remark.rig),
  },
  { head: 'Reason', cell: (remark) => remark.text, value: (remark) => remark.text, wide: true },
];

function Remarks(props: { caption: string; of: Remark[] }) {
  if (props.of.length === 0) return null;
  return (
    <>
      <h3>{props.caption}</h3>
      <DataTable caption={props.caption} columns={kRemarks} items={props.of} />
    </>
  );
}

// The changes of a plan that are made so far.
interface Progress {
  done: number;
  instructed: number; // of those that are done
  failed: Remark[];
  ended: boolean;
}

const kNothing: Progress = { done: 0, instructed: 0, failed: [], ended: false };

function Confirmation(props: {
  action: BulkAction;
  plan: Plan;
  onConfirm: (statement: Statement) => void;
  onCancel: () => void;
}) {
  const { action, plan } = props;
  const [force, setForce] = useState(false);
  const reported = plan.changes.filter((change) => change.isReported).length;
  return (
    <ActionForm
      button={action.imperative}
      withoutReason={action.takes !== 'reason'}
      act={(reason) => Promise.resolve(props.onConfirm({ reason, force }))}
      onCancel={props.onCancel}
    >
      <p>{action.explanation}</p>
      {reported > 0 && (
        <p>
          {reported} of them {reported === 1 ? 'is' : 'are'} reported by a device, which gets an
          instruction and makes the change with its next report.
        </p>
      )}
      <DataTable caption="Rigs to change" columns={kChanges} items={plan.changes} />
      <Remarks caption="Left out" of={plan.leftOut} />
      {action.takes === 'force' && (
        <div class="bar">
          <label>
            <input
              type="checkbox"
              checked={force}
              onChange={(event) => setForce(event.currentTarget.checked)}
            />
            also where the tables have not changed since a version was computed from them
          </label>
        </div>
      )}
    </ActionForm>
  );
}

function resultText(action: BulkAction, of: Progress, total: number): string {
  const left = total - of.done - of.failed.length;
  return [
    `${action.result} on ${of.done - of.instructed} of ${countOf(total)}.`,
    of.instructed > 0 &&
      `Instructions were given to the devices of ${countOf(of.instructed)}; the page Instructions of a rig shows what became of them.`,
    left > 0 && `Stopped before ${countOf(left)}.`,
  ]
    .filter(Boolean)
    .join(' ');
}

// The failures have links, which leave the page: they come when nothing is left
// to be done.
function Course(props: { action: BulkAction; of: Progress; total: number }) {
  const { action, of, total } = props;
  return (
    <>
      <p>
        <Meter value={of.done + of.failed.length} of={total} label="rigs that are done" />
        {of.failed.length > 0 && !of.ended && `, ${of.failed.length} failed`}
      </p>
      <p role="status">{of.ended && resultText(action, of, total)}</p>
      {of.ended && <Remarks caption="Failed" of={of.failed} />}
    </>
  );
}

function titleOf(action: BulkAction, plan: Plan | null, progress: Progress | null): string {
  if (plan === null) return `${action.imperative} ...`;
  const rigs = countOf(plan.changes.length);
  if (plan.changes.length === 0) return `${action.imperative}: no rig to change`;
  if (progress === null) return `${action.imperative} ${rigs}?`;
  return `${action.progressive} ${rigs}` + (progress.ended ? ': ended' : '');
}

function withMade(before: Progress, change: RigChange, failure: string | null): Progress {
  if (failure !== null) {
    return { ...before, failed: [...before.failed, { rig: change.rig, text: failure }] };
  }
  const instructed = before.instructed + (change.isReported ? 1 : 0);
  return { ...before, done: before.done + 1, instructed };
}

// `query` is that of the list of rigs. Closing the dialog stops the changes.
export function BulkDialog(props: {
  action: BulkAction;
  query: Record<string, string>;
  onEnd: () => void;
}) {
  const { action, query, onEnd } = props;
  const [stop] = useState(() => new AbortController());
  const [error, setError] = useState<ApiError | null>(null);
  const [plan, setPlan] = useState<Plan | null>(null);
  const [progress, setProgress] = useState<Progress | null>(null);
  useEffect(() => () => stop.abort(), [stop]);
  useEffect(() => {
    readPlan(action, query, stop.signal).then(setPlan, (failure: Failure) =>
      setError(failure.error),
    );
  }, [action, query, stop]);
  const begin = async (changes: RigChange[], statement: Statement) => {
    setProgress(kNothing);
    await makeChanges(changes, statement, stop.signal, (change, failure) =>
      setProgress((before) => withMade(before ?? kNothing, change, failure)),
    );
    setProgress((before) => ({ ...(before ?? kNothing), ended: true }));
  };
  const content = () => {
    if (plan === null) return <Loaded read={{ value: null, error }}>{() => null}</Loaded>;
    if (plan.changes.length === 0) return <Remarks caption="Left out" of={plan.leftOut} />;
    if (progress !== null) {
      return <Course action={action} of={progress} total={plan.changes.length} />;
    }
    return (
      <Confirmation
        action={action}
        plan={plan}
        onConfirm={(statement) => void begin(plan.changes, statement)}
        onCancel={onEnd}
      />
    );
  };
  const asks = plan !== null && plan.changes.length > 0 && progress === null;
  const works = progress !== null && !progress.ended;
  return (
    <Dialog title={titleOf(action, plan, progress)} onEnd={onEnd}>
      {content()}
      {!asks && (
        <p class="buttons">
          <button type="button" onClick={() => (works ? stop.abort() : onEnd())}>
            {works ? 'Stop' : 'Close'}
          </button>
        </p>
      )}
    </Dialog>
  );
}
