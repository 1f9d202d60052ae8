// Changes of all rigs of a filter: which rigs each of them changes, and making
// them. A rig that fails does not hold up the others.
import { get, post } from './api';
import type { ListActivityResponse, RigActivity } from './contract';
import { instruct, type InstructedCall } from './instruction';

// The statement of the administrator who confirms the changes.
export interface Statement {
  reason: string;
  force: boolean;
}

// A call of the API, and the same as an instruction for a device.
interface Call {
  make: () => Promise<unknown>;
  instruction: InstructedCall;
}

export interface RigChange {
  rig: string; // rigs/{rig}
  effect: string; // e.g. from version 3 to 2
  isReported: boolean; // by its device, which a hub instructs instead
  call: (statement: Statement) => Call;
}

// Why a rig is not changed.
export interface Remark {
  rig: string; // rigs/{rig}
  text: string;
}

export interface Plan {
  changes: RigChange[];
  leftOut: Remark[];
}

export interface BulkAction {
  imperative: string; // Roll back
  progressive: string; // Rolling back
  result: string; // The version before is active
  explanation: string;
  takes: 'reason' | 'force' | 'nothing'; // the part of the statement that it uses
  // The change of a rig, or why it is left out.
  plan: (rig: RigActivity, signal: AbortSignal) => Promise<RigChange | string>;
}

// Calls at a time: the daemon has few connections, which other pages need, too.
const kAtOnce = 4;
const kPageSize = '500';

// Reads all pages of a list.
export async function readAll<R extends { nextPageToken: string }, T>(
  path: string,
  query: Record<string, string>,
  itemsOf: (response: R) => T[],
  signal: AbortSignal,
): Promise<T[]> {
  const items: T[] = [];
  let token = '';
  do {
    const page = new URLSearchParams({ ...query, page_size: kPageSize, page_token: token });
    const response = await get<R>(`${path}?${page}`);
    items.push(...itemsOf(response));
    token = response.nextPageToken;
  } while (token && !signal.aborted);
  return items;
}

// Calls `act` for each item, some at a time, until the signal is aborted.
async function forEach<T>(
  items: T[],
  signal: AbortSignal,
  act: (item: T) => Promise<void>,
): Promise<void> {
  const waiting = items.values();
  const work = async () => {
    for (const item of waiting) {
      if (signal.aborted) return;
      await act(item);
    }
  };
  await Promise.all(Array.from({ length: kAtOnce }, work));
}

const textOf = (failure: Error) => failure.message;

const byRig = (a: { rig: string }, b: { rig: string }) => (a.rig < b.rig ? -1 : 1);

// Reads the rigs of a query of ListActivity, and what the action changes of
// each. Throws a Failure if the rigs cannot be read.
export async function readPlan(
  action: BulkAction,
  query: Record<string, string>,
  signal: AbortSignal,
): Promise<Plan> {
  const rigs = await readAll(
    'activity',
    { ...query, order_by: 'name asc' },
    (response: ListActivityResponse) => response.rigs,
    signal,
  );
  const plan: Plan = { changes: [], leftOut: [] };
  await forEach(rigs, signal, async (rig) => {
    const planned = await action.plan(rig, signal).catch(textOf);
    if (typeof planned === 'string') plan.leftOut.push({ rig: rig.name, text: planned });
    else plan.changes.push(planned);
  });
  return { changes: plan.changes.sort(byRig), leftOut: plan.leftOut.sort(byRig) };
}

// Makes the changes, and reports each with the failure, or null, when it is made.
export async function makeChanges(
  changes: RigChange[],
  statement: Statement,
  signal: AbortSignal,
  onMade: (change: RigChange, failure: string | null) => void,
): Promise<void> {
  await forEach(changes, signal, async (change) => {
    const { make, instruction } = change.call(statement);
    const made = change.isReported ? instruct(change.rig, instruction) : make();
    onMade(change, await made.then(() => null, textOf));
  });
}

export const kRecalibrate: BulkAction = {
  imperative: 'Recalibrate',
  progressive: 'Recalibrating',
  result: 'A run was started',
  explanation: 'Each rig gets a run on the segments that its tables hold now.',
  takes: 'force',
  plan: (rig) =>
    Promise.resolve({
      rig: rig.name,
      effect: 'start a run',
      isReported: rig.device !== undefined,
      call: ({ force }) => ({
        make: () => post(rig.name + '/recalibrations', { force }),
        instruction: { startRecalibration: { parent: rig.name, force } },
      }),
    }),
};
