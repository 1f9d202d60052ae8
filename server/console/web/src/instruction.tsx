// Instructions: changes of a rig that a device reports to this hub, which the hub
// has the device make.
import { idOf, pageOf, post, rigOf } from './api';
import type { Instruction, ListActivityResponse } from './contract';
import { Link } from './parts';
import type { RigUpdate } from './rig_update';
import { useRead, type Read } from './state';

// The call that the device makes.
export type InstructedCall = Pick<
  Instruction,
  'activateCalibration' | 'startRecalibration' | 'quarantineSegments'
> & {
  updateRig?: RigUpdate;
};

// `rig` is the name of the resource, rigs/{rig}.
export async function instruct(rig: string, call: InstructedCall): Promise<Instruction> {
  return post(rig + '/instructions', call);
}

// Reads the activity of one rig, which has a `device` if one reports it.
export function useActivity(rig: string, version: number): Read<ListActivityResponse> {
  const filter = new URLSearchParams({ filter: `name = "${rig}"` });
  return useRead(`activity?${filter}`, version);
}

// True if a device reports the rig of this activity.
export function isReported({ rigs }: ListActivityResponse): boolean {
  return rigs.some((rig) => rig.device !== undefined);
}

// States that the instruction was given, and where its result is shown.
export function Given(props: { of: Instruction }) {
  const { name } = props.of;
  const rig = rigOf(name);
  return (
    <p class="box" role="status">
      Instruction {idOf(name)} was given to the device of rig {idOf(rig)}, which carries it out with
      its next report. <Link to={pageOf(rig) + '/instructions'}>Instructions</Link> shows what
      became of it.
    </p>
  );
}
