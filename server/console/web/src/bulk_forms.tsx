// Forms in which an administrator enters a change of many rigs, before it is
// shown for each of them and confirmed.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { ActionForm, Dialog } from './action';
import { Failure } from './api';
import type { BulkAction } from './bulk';
import { rollbackAction } from './bulk_rollback';
import { kSettings, labelAction, settingsAction, type Setting } from './bulk_updates';
import { linesOf, parseLabels } from './labels';
import { kTimeHint, timeOf } from './time_input';

export interface BulkForm {
  imperative: string; // as that of the action
  Form: (props: FormProps) => JSX.Element;
}

interface FormProps {
  onAction: (action: BulkAction) => void;
  onEnd: () => void;
}

function invalid(message: string, whatToDo: string): Failure {
  return new Failure({ code: 'INVALID_ARGUMENT', message, whatToDo });
}

const nothing = () => invalid('There is nothing to change.', 'Fill in at least one field.');

function RollbackForm(props: FormProps) {
  const [since, setSince] = useState('');
  const [again, setAgain] = useState(false);
  const act = () => {
    const text = since.trim();
    const time = timeOf(text, new Date());
    if (text !== '' && time === null) throw invalid(`'${text}' is not a time.`, kTimeHint);
    props.onAction(rollbackAction({ since: time, again }));
    return Promise.resolve();
  };
  return (
    <Dialog title="Roll back these rigs" onEnd={props.onEnd}>
      <ActionForm button="Continue" act={act} onCancel={props.onEnd} withoutReason>
        <label>
          Only where the active version was created since then: a time in UTC, or 2d
          <input
            type="text"
            value={since}
            placeholder="any time"
            onInput={(event) => setSince(event.currentTarget.value)}
          />
        </label>
        <div class="bar">
          <label>
            <input
              type="checkbox"
              checked={again}
              onChange={(event) => setAgain(event.currentTarget.checked)}
            />
            also where a version was rolled back before, and no newer one has become active since
          </label>
        </div>
      </ActionForm>
    </Dialog>
  );
}

function LabelForm(props: FormProps) {
  const [set, setSet] = useState('');
  const [removed, setRemoved] = useState('');
  const act = () => {
    const change = { set: parseLabels(set), removed: linesOf(removed) };
    if (Object.keys(change.set).length + change.removed.length === 0) throw nothing();
    props.onAction(labelAction(change));
    return Promise.resolve();
  };
  return (
    <Dialog title="Label these rigs" onEnd={props.onEnd}>
      <ActionForm button="Continue" act={act} onCancel={props.onEnd} withoutReason>
        <label>
          Labels to set, one on each line, as site = lab
          <textarea value={set} onInput={(event) => setSet(event.currentTarget.value)} />
        </label>
        <label>
          Labels to remove, one name on each line
          <textarea value={removed} onInput={(event) => setRemoved(event.currentTarget.value)} />
        </label>
      </ActionForm>
    </Dialog>
  );
}

// The values of the fields that are not empty.
function read(texts: Record<string, string>): [Setting, number][] {
  return kSettings.flatMap((setting): [Setting, number][] => {
    const text = (texts[setting.name] ?? '').trim();
    if (text === '') return [];
    const value = setting.parse(text);
    if (value === null) {
      throw invalid(`'${text}' is not a value of ${setting.name}.`, `Enter ${setting.hint}.`);
    }
    return [[setting, value]];
  });
}

function SettingsForm(props: FormProps) {
  const [texts, setTexts] = useState<Record<string, string>>({});
  const act = () => {
    const values = read(texts);
    if (values.length === 0) throw nothing();
    props.onAction(settingsAction(values));
    return Promise.resolve();
  };
  return (
    <Dialog title="Configure these rigs" onEnd={props.onEnd}>
      <ActionForm button="Continue" act={act} onCancel={props.onEnd} withoutReason>
        <p>A field that is left empty changes nothing.</p>
        {kSettings.map(({ name, label, hint }) => (
          <label key={name}>
            <span>
              {label} (<code>{name}</code>)
            </span>
            <input
              type="text"
              value={texts[name] ?? ''}
              placeholder={hint}
              onInput={(event) => setTexts({ ...texts, [name]: event.currentTarget.value })}
            />
          </label>
        ))}
      </ActionForm>
    </Dialog>
  );
}

export const kRollBack: BulkForm = { imperative: 'Roll back', Form: RollbackForm };
export const kLabel: BulkForm = { imperative: 'Label', Form: LabelForm };
export const kConfigure: BulkForm = { imperative: 'Configure', Form: SettingsForm };
