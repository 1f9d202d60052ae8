// Keys that work on every page. Those of tables, plots and paths in space work
// while these have the focus.
import { useEffect, useRef } from 'preact/hooks';

const kKeys: [string, string][] = [
  ['/', 'go to the search field of the page'],
  ['?', 'show these keys'],
  ['Arrow keys in a table', 'go to another row; Enter opens it'],
  ['Arrow keys in a plot', 'go to another value, Home and End to the first and the last'],
  ['Arrow keys in a path in space', 'rotate it; + and - zoom, Home resets the view'],
];

function isTyping(target: EventTarget | null): boolean {
  return target instanceof Element && target.closest('input, select, textarea, dialog') !== null;
}

function focusSearch(): void {
  document.querySelector<HTMLInputElement>('main input[type=search]')?.focus();
}

export function ShortcutHelp() {
  const dialog = useRef<HTMLDialogElement>(null);
  const show = () => dialog.current?.showModal();
  useEffect(() => {
    const actions: Record<string, () => void> = { '/': focusSearch, '?': show };
    const onKey = (event: KeyboardEvent) => {
      if (!(event.key in actions) || isTyping(event.target)) return;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      actions[event.key]();
    };
    addEventListener('keydown', onKey);
    return () => removeEventListener('keydown', onKey);
  }, []);
  return (
    <>
      <button type="button" onClick={show}>
        Keys
      </button>
      <dialog ref={dialog} aria-labelledby="keys">
        <h2 id="keys">Keys</h2>
        <dl>
          {kKeys.map(([key, meaning]) => (
            <div key={key}>
              <dt>
                <kbd>{key}</kbd>
              </dt>
              <dd>{meaning}</dd>
            </div>
          ))}
        </dl>
        <form method="dialog" class="buttons">
          <button type="submit">Close</button>
        </form>
      </dialog>
    </>
  );
}
