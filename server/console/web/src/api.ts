// Calls of the API over HTTP. A path is what the contract (google.api.http in
// proto/) has after /v1/.

export interface ApiError {
  code: string;
  message: string;
  whatToDo: string;
}

export class Failure extends Error {
  constructor(readonly error: ApiError) {
    super(error.message);
  }
}

// The address of a path of the API.
export function addressOf(path: string): string {
  return '/api/v1/' + path;
}

async function answer<T>(response: Response): Promise<T> {
  const text = await response.text();
  let body: unknown;
  try {
    body = JSON.parse(text);
  } catch {
    body = null;
  }
  if (response.ok && body !== null) return body as T;
  const error = body as ApiError | null;
  throw new Failure(
    error?.code
      ? error
      : {
          code: String(response.status),
          message: 'The response of the daemon cannot be read.',
          whatToDo: 'Reload the page; see the log of selfcald.',
        },
  );
}

async function reach(path: string, init?: RequestInit): Promise<Response> {
  try {
    return await fetch(addressOf(path), init);
  } catch {
    throw new Failure({
      code: 'UNAVAILABLE',
      message: 'The daemon does not answer.',
      whatToDo: 'Check that selfcald is running; this page reconnects by itself.',
    });
  }
}

export async function get<T>(path: string): Promise<T> {
  return answer<T>(await reach(path));
}

// The header is one that pages of other sites cannot send.
async function change<T>(method: string, path: string, body?: unknown): Promise<T> {
  return answer<T>(
    await reach(path, {
      method,
      headers: { 'Content-Type': 'application/json', 'X-Selfcal-Console': '1' },
      body: body === undefined ? undefined : JSON.stringify(body),
    }),
  );
}

export async function post<T>(path: string, body: unknown): Promise<T> {
  return change<T>('POST', path, body);
}

export async function patch<T>(path: string, body: unknown): Promise<T> {
  return change<T>('PATCH', path, body);
}

export async function remove(path: string, reason: string): Promise<void> {
  await change('DELETE', path + '?reason=' + encodeURIComponent(reason));
}

// The last part of a resource name, encoded as in an address.
export function idOf(name: string): string {
  return name.slice(name.lastIndexOf('/') + 1);
}

// rigs/{rig}, of the name of a resource of the rig.
export function rigOf(name: string): string {
  return name.split('/', 2).join('/');
}

// The path of a rig.
export function rigPath(rig: string): string {
  return 'rigs/' + encodeURIComponent(rig);
}

// The address of the page of a resource, which is that of its name.
export function pageOf(name: string): string {
  return '/' + name.split('/').map(encodeURIComponent).join('/');
}
