// Changes of the labels and of the settings of all rigs of a filter.
import { get } from './api';
import type { BulkAction, RigChange } from './bulk';
import type { Rig, RigActivity } from './contract';
import { durationText, number, secondsOf } from './format';
import type { LabelMap } from './labels';
import { updateRig, type RigUpdate } from './rig_update';

// The change of a rig by UpdateRig. `effect` is '' if it is so already.
function changeOf(rig: RigActivity, effect: string, update: RigUpdate): RigChange | string {
  if (!effect) return 'It is so already.';
  return {
    rig: rig.name,
    effect,
    isReported: rig.device !== undefined,
    call: () => ({ make: () => updateRig(update), instruction: { updateRig: update } }),
  };
}

export interface LabelChange {
  set: LabelMap;
  removed: string[]; // names
}

// Other labels of a rig stay as they are.
export function labelAction({ set, removed }: LabelChange): BulkAction {
  const effectOn = (labels: LabelMap) => [
    ...Object.keys(set)
      .filter((name) => !removed.includes(name) && labels[name] !== set[name])
      .map((name) => `${name} = ${set[name]}` + (name in labels ? ` (now ${labels[name]})` : '')),
    ...removed.filter((name) => name in labels).map((name) => 'without ' + name),
  ];
  return {
    imperative: 'Label',
    progressive: 'Labelling',
    result: 'The labels were changed',
    explanation: 'Other labels of these rigs stay as they are.',
    takes: 'nothing',
    plan: (rig) => {
      const after = Object.entries({ ...rig.labels, ...set });
      const labels = Object.fromEntries(after.filter(([name]) => !removed.includes(name)));
      const update = { rig: { name: rig.name, labels }, updateMask: 'labels' };
      return Promise.resolve(changeOf(rig, effectOn(rig.labels).join(', '), update));
    },
  };
}

// A setting of a rig that is a number: of seconds, if it is a duration.
export interface Setting {
  field: keyof Rig;
  name: string; // in the contract
  label: string;
  hint: string; // what its values are
  parse: (text: string) => number | null; // null: the text is no value
  of: (rig: Rig) => number;
  text: (value: number) => string;
  json: (value: number) => string | number;
}

type DurationField = 'tableMaxAge' | 'recalibrationMinInterval' | 'calibrationMaxAge';

function duration(field: DurationField, name: string, label: string): Setting {
  return {
    field,
    name,
    label,
    hint: 'a time as 30 d, 12 h, 10 min or 45 s; 0: none',
    parse: secondsOf,
    of: (rig) => parseFloat(rig[field] ?? '0'),
    text: durationText,
    json: (seconds) => `${seconds}s`,
  };
}

function quantity(
  field: 'minGainNats' | 'retriggerFraction',
  name: string,
  label: string,
  hint: string,
): Setting {
  return {
    field,
    name,
    label,
    hint,
    parse: (text) => (text.trim() !== '' && Number.isFinite(Number(text)) ? Number(text) : null),
    of: (rig) => rig[field] ?? NaN,
    text: (value) => number(value),
    json: (value) => value,
  };
}

export const kSettings: Setting[] = [
  duration('tableMaxAge', 'table_max_age', 'Age at which segments leave the tables'),
  duration('recalibrationMinInterval', 'recalibration_min_interval', 'Minimum time between runs'),
  duration(
    'calibrationMaxAge',
    'calibration_max_age',
    'Age of the active version that triggers a run',
  ),
  quantity(
    'minGainNats',
    'min_gain_nats',
    'Minimum gain of a segment to enter a table',
    'a number from 0 [nat]',
  ),
  quantity(
    'retriggerFraction',
    'retrigger_fraction',
    'Fraction of the table entries that must be new to trigger another run',
    'a number above 0, to 1',
  ),
];

// Settings that are not among the values stay as they are.
export function settingsAction(values: [Setting, number][]): BulkAction {
  return {
    imperative: 'Configure',
    progressive: 'Configuring',
    result: 'The settings were changed',
    explanation: 'Other settings of these rigs stay as they are.',
    takes: 'nothing',
    plan: async (rig) => {
      const before = await get<Rig>(rig.name);
      const changed = values.filter(([setting, value]) => setting.of(before) !== value);
      const effect = changed.map(
        ([{ name, of, text }, value]) => `${name}: ${text(of(before))} to ${text(value)}`,
      );
      const fields = changed.map(([{ field, json }, value]) => [field, json(value)]);
      return changeOf(rig, effect.join(', '), {
        rig: { name: rig.name, ...(Object.fromEntries(fields) as Partial<Rig>) },
        updateMask: changed.map(([{ field }]) => field).join(),
      });
    },
  };
}
