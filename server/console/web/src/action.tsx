// A change that an administrator makes: it is confirmed in a dialog, and the
// event log records the reason.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { Failure, type ApiError } from './api';
import type { Caller } from './contract';
import { Problem } from './parts';

// `rig` is the name of the resource, rigs/{rig}. A role on the rigs with a label
// may be one on this rig: then the daemon decides.
export function mayAdminister(caller: Caller | null, rig: string): boolean {
  return (caller?.grants ?? []).some(
    (grant) => grant.role === 'administer' && (grant.rig === '' || grant.rig === rig),
  );
}

// `act` makes the change; what it throws is shown, and the dialog stays.
export function ActionDialog(props: {
  title: string;
  button: string;
  act: (reason: string) => Promise<void>;
  onEnd: () => void;
  withoutReason?: boolean;
  children: ComponentChildren;
}) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [reason, setReason] = useState('');
  const [error, setError] = useState<ApiError | null>(null);
  const [busy, setBusy] = useState(false);
  useEffect(() => dialog.current?.showModal(), []);
  const send = async (event: SubmitEvent) => {
    event.preventDefault();
    setBusy(true);
    try {
      await props.act(reason);
      props.onEnd();
    } catch (failure) {
      setError((failure as Failure).error);
      setBusy(false);
    }
  };
  const ready = props.withoutReason || reason.trim() !== '';
  return (
    <dialog ref={dialog} onClose={props.onEnd} aria-labelledby="action">
      <form onSubmit={(event) => void send(event)}>
        <h2 id="action">{props.title}</h2>
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
          <button type="button" onClick={props.onEnd}>
            Cancel
          </button>
          <button type="submit" class="strong" disabled={busy || !ready}>
            {props.button}
          </button>
        </p>
      </form>
    </dialog>
  );
}
