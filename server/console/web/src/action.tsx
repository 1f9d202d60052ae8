// A change that an administrator makes: it is confirmed in a dialog, and the
// event log records the reason.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { Failure, type ApiError } from './api';
import type { Caller } from './contract';
import { Problem } from './parts';

// `rig` is the name of the resource, rigs/{rig}; without it, of any rig. A role
// on the rigs with a label may be one on this rig: then the daemon decides.
export function mayAdminister(caller: Caller | null, rig?: string): boolean {
  return (caller?.grants ?? []).some(
    (grant) =>
      grant.role === 'administer' && (rig === undefined || grant.rig === '' || grant.rig === rig),
  );
}

// The title gets the focus when it changes while the dialog is open.
export function Dialog(props: { title: string; onEnd: () => void; children: ComponentChildren }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const heading = useRef<HTMLHeadingElement>(null);
  const opened = useRef(props.title); // no focus when it opens
  useEffect(() => dialog.current?.showModal(), []);
  useEffect(() => {
    if (props.title === opened.current || !heading.current) return;
    opened.current = props.title;
    heading.current.tabIndex = -1;
    heading.current.focus();
  }, [props.title]);
  return (
    <dialog ref={dialog} onClose={props.onEnd} aria-labelledby="action">
      <h2 id="action" ref={heading}>
        {props.title}
      </h2>
      {props.children}
    </dialog>
  );
}

// `act` makes the change; what it throws is shown, and the form stays.
export function ActionForm(props: {
  button: string;
  act: (reason: string) => Promise<void>;
  onCancel: () => void;
  withoutReason?: boolean;
  children: ComponentChildren;
}) {
  const [reason, setReason] = useState('');
  const [error, setError] = useState<ApiError | null>(null);
  const [busy, setBusy] = useState(false);
  const send = async (event: SubmitEvent) => {
    event.preventDefault();
    setBusy(true);
    try {
      await props.act(reason);
    } catch (failure) {
      setError((failure as Failure).error);
      setBusy(false);
    }
  };
  const ready = props.withoutReason || reason.trim() !== '';
  return (
    <form onSubmit={(event) => void send(event)}>
      {props.children}
      {!props.withoutReason && (
        <label>
          Reason
          <textarea
            required
            maxLength={500}
            value={reason}
            onInput={(event) => setReason(event.currentTarget.value)}
          />
        </label>
      )}
      {error && <Problem error={error} />}
      <p class="buttons">
        <button type="button" onClick={props.onCancel}>
          Cancel
        </button>
        <button type="submit" class="strong" disabled={busy || !ready}>
          {props.button}
        </button>
      </p>
    </form>
  );
}

// The dialog ends once the change is made.
export function ActionDialog(props: {
  title: string;
  button: string;
  act: (reason: string) => Promise<void>;
  onEnd: () => void;
  withoutReason?: boolean;
  children: ComponentChildren;
}) {
  const { title, act, onEnd, ...form } = props;
  return (
    <Dialog title={title} onEnd={onEnd}>
      <ActionForm {...form} act={(reason) => act(reason).then(onEnd)} onCancel={onEnd} />
    </Dialog>
  );
}
