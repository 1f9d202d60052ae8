// Streams of messages from the daemon, as server-sent events. The browser
// reconnects by itself until the stream is closed.
import { addressOf, type ApiError } from './api';

export interface StreamListener<T> {
  onMessage: (message: T) => void;
  onOpen?: () => void;
  onError?: (error: ApiError) => void; // the daemon has ended the stream
  onLost?: () => void; // the connection has ended, also after an error
}

// Returns a function that closes the stream.
export function openStream<T>(path: string, listener: StreamListener<T>): () => void {
  const source = new EventSource(addressOf(path));
  source.onopen = () => listener.onOpen?.();
  source.onmessage = (event: MessageEvent<string>) =>
    listener.onMessage(JSON.parse(event.data) as T);
  // The daemon's errors have the same name as the browser's own event about a
  // lost connection, which has no data.
  source.onerror = (event) => {
    if (event instanceof MessageEvent) {
      listener.onError?.(JSON.parse(event.data as string) as ApiError);
    } else {
      listener.onLost?.();
    }
  };
  return () => source.close();
}
