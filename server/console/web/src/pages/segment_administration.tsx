// The changes of a segment that an administrator may make on its page.
import { useState } from 'preact/hooks';
import { ActionDialog } from '../action';
import { idOf, pageOf, post, remove, rigOf } from '../api';
import type { Instruction, Segment } from '../contract';
import { Given, instruct, isReported, useActivity } from '../instruction';
import { Loaded } from '../parts';
import { go } from '../state';

// SESSION~INDEX, as people read it.
const keyOf = (segment: Segment) => decodeURIComponent(idOf(segment.name));

// The device of the rig is instructed if one reports it.
function Quarantine(props: {
  of: Segment;
  isReported: boolean;
  onGiven: (instruction: Instruction) => void;
  onChange: () => void;
  onEnd: () => void;
}) {
  const rig = rigOf(props.of.name);
  const key = keyOf(props.of);
  const at = key.lastIndexOf('~');
  const act = async (reason: string) => {
    const chosen = { session: key.slice(0, at), index: key.slice(at + 1), reason };
    if (props.isReported) {
      props.onGiven(await instruct(rig, { quarantineSegments: { parent: rig, ...chosen } }));
    } else {
      await post(rig + '/segments:quarantine', chosen);
      props.onChange();
    }
  };
  return (
    <ActionDialog
      title={`Quarantine the segment ${key}?`}
      button="Quarantine"
      act={act}
      onEnd={props.onEnd}
    >
      {props.isReported && (
        <p>
          A device reports this rig: it gets an instruction, and quarantines the segment with its
          next report. Its event log records the reason.
        </p>
      )}
      <p>It leaves the tables, and no calibration uses it any more. This cannot be undone.</p>
    </ActionDialog>
  );
}

function Delete(props: { of: Segment; onEnd: () => void }) {
  const { name } = props.of;
  const rig = rigOf(name);
  return (
    <ActionDialog
      title={`Delete the segment ${keyOf(props.of)}?`}
      button="Delete"
      act={async (reason) => {
        await remove(`${rig}/segments/${encodeURIComponent(idOf(name))}`, reason);
        go(pageOf(rig) + '/segments');
      }}
      onEnd={props.onEnd}
    >
      <p>
        Its data, its score and its place in tables are deleted. This cannot be undone. A segment
        that a calibration was computed from is refused: quarantine it instead.
      </p>
    </ActionDialog>
  );
}

export function SegmentAdministration(props: {
  of: Segment;
  version: number;
  onChange: () => void;
}) {
  const [asked, setAsked] = useState<'quarantine' | 'delete' | null>(null);
  const [given, setGiven] = useState<Instruction | null>(null);
  const activity = useActivity(idOf(rigOf(props.of.name)), props.version);
  return (
    <Loaded read={activity}>
      {(found) => (
        <>
          {given && <Given of={given} />}
          <p class="buttons">
            <button type="button" onClick={() => setAsked('quarantine')}>
              Quarantine
            </button>
            {!isReported(found) && (
              <button type="button" onClick={() => setAsked('delete')}>
                Delete
              </button>
            )}
          </p>
          {isReported(found) && (
            <p class="quiet">
              A device reports this rig: only the device can delete the segment, with{' '}
              <code>selfcal segment delete</code>.
            </p>
          )}
          {asked === 'quarantine' && (
            <Quarantine
              of={props.of}
              isReported={isReported(found)}
              onGiven={setGiven}
              onChange={props.onChange}
              onEnd={() => setAsked(null)}
            />
          )}
          {asked === 'delete' && <Delete of={props.of} onEnd={() => setAsked(null)} />}
        </>
      )}
    </Loaded>
  );
}
