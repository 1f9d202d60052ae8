// Labels of a rig: NAME = VALUE, by which operators group and filter rigs.
import { useState } from 'preact/hooks';
import { ActionDialog } from './action';
import { Failure } from './api';
import type { Instruction, Rig } from './contract';
import { instruct } from './instruction';
import { updateRig } from './rig_update';

export type LabelMap = Record<string, string>;

export function Labels(props: { of: LabelMap }) {
  const names = Object.keys(props.of).sort();
  if (names.length === 0) return <span class="quiet">none</span>;
  return (
    <ul class="labels">
      {names.map((name) => (
        <li key={name}>
          {name} = {props.of[name]}
        </li>
      ))}
    </ul>
  );
}

function textOf(labels: LabelMap): string {
  return Object.keys(labels)
    .sort()
    .map((name) => `${name} = ${labels[name]}\n`)
    .join('');
}

// The lines that are not empty.
export function linesOf(text: string): string[] {
  return text
    .split('\n')
    .map((line) => line.trim())
    .filter(Boolean);
}

// One label on each line; throws for a line that has none.
export function parseLabels(text: string): LabelMap {
  const labels: LabelMap = {};
  for (const line of linesOf(text)) {
    const at = line.indexOf('=');
    const name = line.slice(0, at).trim();
    if (at < 0 || name === '') {
      throw new Failure({
        code: 'INVALID_ARGUMENT',
        message: `'${line}' is not a label.`,
        whatToDo: 'Write one label on each line, as site = lab.',
      });
    }
    labels[name] = line.slice(at + 1).trim();
  }
  return labels;
}

// The device of the rig is instructed if one reports it.
export function EditLabels(props: {
  rig: string;
  of: Rig;
  isReported: boolean;
  onGiven: (instruction: Instruction) => void;
  onEnd: () => void;
}) {
  const { name } = props.of;
  const [text, setText] = useState(textOf(props.of.labels));
  const act = async () => {
    const update = { rig: { name, labels: parseLabels(text) }, updateMask: 'labels' };
    if (props.isReported) props.onGiven(await instruct(name, { updateRig: update }));
    else await updateRig(update);
  };
  return (
    <ActionDialog
      title={`Labels of ${props.rig}`}
      button="Save"
      act={act}
      onEnd={props.onEnd}
      withoutReason
    >
      <label>
        One label on each line, as site = lab
        <textarea value={text} onInput={(event) => setText(event.currentTarget.value)} />
      </label>
    </ActionDialog>
  );
}
