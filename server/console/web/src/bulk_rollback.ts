// Roll-back of all rigs of a filter: the version before the active one becomes
// active again. A rig that is rolled back already is left as it is, so that the
// roll-back can be repeated where it failed for some rigs.
import { idOf, post } from './api';
import { readAll, type BulkAction, type RigChange } from './bulk';
import type { Calibration, ListCalibrationsResponse, RigActivity } from './contract';
import { clock } from './format';

export interface RollbackChoices {
  since: Date | null; // only versions that were created then or later
  again: boolean; // also rigs that are rolled back already
}

// The change of a rig, or why there is none. The versions are ordered from the
// newest.
function rollbackOf(
  rig: RigActivity,
  versions: Calibration[],
  { since, again }: RollbackChoices,
): RigChange | string {
  const at = versions.findIndex((version) => version.state === 'ACTIVE');
  if (at < 0) return 'It has no active version.';
  const { version: active, createTime } = versions[at];
  if (since && Date.parse(createTime ?? '') < since.getTime()) {
    return `Its active version ${active} was created before, at ${clock(createTime)}.`;
  }
  const undone = versions.slice(0, at).find((version) => version.state === 'ROLLED_BACK');
  if (undone && !again) {
    return `It is rolled back already, from version ${undone.version} to ${active}; a checkbox before this list rolls it back further.`;
  }
  const before = versions.slice(at + 1).find((version) => version.state === 'SUPERSEDED');
  if (!before) return `No version was active before version ${active}.`;
  const { name } = before;
  return {
    rig: rig.name,
    effect: `from version ${active} to ${idOf(name)}`,
    isReported: rig.device !== undefined,
    call: ({ reason }) => ({
      make: () => post(name + ':activate', { reason }),
      instruction: { activateCalibration: { name, reason } },
    }),
  };
}

function explanationOf({ since, again }: RollbackChoices): string {
  return [
    'Every device that watches these rigs receives the version at once. The event logs record the reason.',
    since && `Only versions that were created since ${clock(since.toISOString())} are rolled back.`,
    again && 'Rigs that are rolled back already are rolled back further.',
  ]
    .filter(Boolean)
    .join(' ');
}

export function rollbackAction(choices: RollbackChoices): BulkAction {
  return {
    imperative: 'Roll back',
    progressive: 'Rolling back',
    result: 'The version before is active',
    explanation: explanationOf(choices),
    takes: 'reason',
    plan: async (rig, signal) => {
      const versions = await readAll(
        rig.name + '/calibrations',
        { view: 'BASIC' },
        (response: ListCalibrationsResponse) => response.calibrations,
        signal,
      );
      return rollbackOf(rig, versions, choices);
    },
  };
}
