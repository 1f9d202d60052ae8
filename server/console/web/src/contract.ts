// The messages of the contract, as the daemon prints them in JSON. web.cmake
// generates the types from proto/ when the console is built.
export type * from '../generated/selfcal/v1/activity_service';
export type * from '../generated/selfcal/v1/calibration';
export type * from '../generated/selfcal/v1/calibration_service';
export type * from '../generated/selfcal/v1/fleet';
export type * from '../generated/selfcal/v1/recalibration';
export type * from '../generated/selfcal/v1/rig';
export type * from '../generated/selfcal/v1/segment';
export type * from '../generated/selfcal/v1/session';
export type * from '../generated/selfcal/v1/store_service';
export type * from '../generated/selfcal/v1/uplink';
// Enumerations whose values menus offer.
export { Calibration_State, Verdict_Kind } from '../generated/selfcal/v1/calibration_service';
export { Recalibration_State, Recalibration_Trigger } from '../generated/selfcal/v1/recalibration';
export { Segment_State, TableExclusion_Cause } from '../generated/selfcal/v1/segment';
