// Labels of a rig: NAME = VALUE, by which operators group and filter rigs.
import { useState } from 'preact/hooks';
import { ActionDialog } from './action';
import { Failure, patch, rigPath } from './api';
import type { Rig } from './contract';

type LabelMap = Record<string, string>;

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

// One label on each line; throws for a line that has none.
function parse(text: string): LabelMap {
  const labels: LabelMap = {};
  for (const line of text.split('\n')) {
    if (line.trim() === '') continue;
    const at = line.indexOf('=');
    const name = line.slice(0, at).trim();
    if (at < 0 || name === '') {
      throw new Failure({
        code: 'INVALID_ARGUMENT',
        message: `'${line.trim()}' is not a label.`,
        whatToDo: 'Write one label on each line, as site = lab.',
      });
    }
    labels[name] = line.slice(at + 1).trim();
  }
  return labels;
}

export function EditLabels(props: { rig: string; of: Rig; onEnd: () => void }) {
  const [text, setText] = useState(textOf(props.of.labels));
  const act = async () => {
    const labels = parse(text);
    await patch(rigPath(props.rig) + '?updateMask=labels', { name: props.of.name, labels });
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
