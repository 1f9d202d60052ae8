// Generates the types of the contract's messages: generate.mjs PROTOC PROTO_FOLDER
import { spawnSync } from 'node:child_process';
import { mkdirSync, readdirSync, rmSync } from 'node:fs';
import process from 'node:process';

const [protoc, proto] = process.argv.slice(2);

// The messages as the daemon prints them in JSON: all fields except messages and optional fields
// that are not set; times, 64-bit integers and enumerators as strings.
const options = [
  'onlyTypes=true',
  'useJsonWireFormat=true',
  'forceLong=string',
  'useOptionals=messages',
  'enumsAsLiterals=true',
  'unrecognizedEnum=false',
  'outputServices=false',
  'exportCommonSymbols=false',
  'emitImportedFiles=false',
];

rmSync('generated', { recursive: true, force: true });
mkdirSync('generated');
const { status, error } = spawnSync(
  protoc,
  [
    `--proto_path=${proto}`,
    '--plugin=protoc-gen-ts_proto=node_modules/.bin/protoc-gen-ts_proto',
    '--ts_proto_out=generated',
    `--ts_proto_opt=${options.join(',')}`,
    ...readdirSync(`${proto}/selfcal/v1`)
      .filter((name) => name.endsWith('.proto'))
      .map((name) => `selfcal/v1/${name}`),
  ],
  { stdio: 'inherit' },
);
if (error) throw error;
process.exitCode = status ?? 1;
