// UpdateRig: the fields of a rig that it changes, and the call.
import { patch } from './api';
import type { Rig } from './contract';

export interface RigUpdate {
  rig: Pick<Rig, 'name'> & Partial<Rig>;
  updateMask: string; // the fields that change, with commas in between
}

export async function updateRig({ rig, updateMask }: RigUpdate): Promise<Rig> {
  return patch(`${rig.name}?${new URLSearchParams({ updateMask })}`, rig);
}
